"""What couples the frames of a stream's window: jerk, the base's acceleration, and speed.

`robots.solver.smoothness` couples those of whole clips. Without later frames, accelerations that
are held back would lag. So those of the base are compared with the source's, and what gives way
to feet and floor fades in it; and of hinges the jerk is held back, which leaves an even turn, and
an even start of one, as it is. Both reach beyond the newest frame (`robots.stream.prediction`).
"""

import numpy as np
from jaxtyping import Float

from robots.model.morphology import Morphology
from robots.solver.smoothness import acceleration_weights
from robots.solver.weights import MAX_HINGE_SPEED, W_OVERSPEED
from robots.solver.weights import SMOOTH_CUTOFF as WHOLE_CLIP_CUTOFF
from robots.stream.prediction import Ahead, CostToGo

BASE_CUTOFF = 1.0  # [Hz] above which the base's motion against the source's fades,
JERK_CUTOFF = 2.5  # and that of hinges, by their jerk
_BASE = slice(0, 3)  # dofs of the base's position


class Coupling:
    """Of `free` frames to each other and to the `fixed` ones before them; all weights squared."""

    def __init__(self, robot: Morphology, frame_time: float, *, fixed: int, free: int) -> None:
        whole = acceleration_weights(robot) * (2 * np.pi * WHOLE_CLIP_CUTOFF) ** 2
        base, hinges = 2 * np.pi * BASE_CUTOFF * frame_time, 2 * np.pi * JERK_CUTOFF * frame_time
        self._weights = (whole / hinges**3) ** 2
        self._weights[_BASE] = (whole[_BASE] / base**2) ** 2
        self._overspeed_weight = (W_OVERSPEED / frame_time) ** 2
        self._first, self._second, self._third = (
            np.diff(np.eye(fixed + free), k, axis=0)[:, fixed:] for k in (1, 2, 3)
        )
        self._base_to_go, self._to_go = CostToGo(frame_time, 2), CostToGo(frame_time, 3)
        self._max_steps = np.full(robot.tree.nv, np.inf)
        hinges = robot.tree.dof_starts[~robot.tree.balls]
        self._max_steps[hinges] = MAX_HINGE_SPEED * frame_time

    def add_to(
        self,
        steps: Float[np.ndarray, "V D"],
        hips: Float[np.ndarray, "T 3"],
        ahead: Ahead,
        blocks: Float[np.ndarray, "F D F D"],
        g: Float[np.ndarray, "F D"],
    ) -> None:
        """Add to the normal equations: `steps` are the dofs' from frame to frame, `hips` the path
        that the source asks for [m], and `ahead` is what is expected of the dofs."""
        against = steps.copy()
        against[:, _BASE] -= np.diff(hips, axis=0)
        base, rest = np.zeros_like(self._weights), self._weights.copy()
        base[_BASE], rest[_BASE] = self._weights[_BASE], 0.0
        accelerations = np.diff(against, axis=0)
        for differences, values, weights in (
            (self._second, accelerations, base),
            (self._third, np.diff(accelerations, axis=0), rest),
        ):
            g += weights * (differences.T @ values)
            _add_products(blocks, differences.T @ differences, weights)
        self._add_beyond(against, ahead, blocks, g)
        overspeed = steps - np.clip(steps, -self._max_steps, self._max_steps)
        if overspeed.any():
            g += self._overspeed_weight * (self._first.T @ overspeed)
            fast = self._overspeed_weight * (overspeed != 0)
            for row, weights in zip(self._first, fast, strict=True):
                _add_products(blocks, np.outer(row, row), weights)

    def _add_beyond(
        self,
        steps: Float[np.ndarray, "V D"],
        ahead: Ahead,
        blocks: Float[np.ndarray, "F D F D"],
        g: Float[np.ndarray, "F D"],
    ) -> None:
        """What the frames after the newest one will cost; `steps` of the base are against the
        source's, so that it is taken to stand still."""
        weights = self._weights
        P, p = self._to_go.of(weights, ahead.weights, ahead.targets, ahead.speeds)
        P[_BASE], p[_BASE] = self._base_to_go.of(
            weights[_BASE], ahead.weights[_BASE], ahead.targets[_BASE], np.zeros(3)
        )
        x = np.stack([-steps[-1] - steps[-2], -steps[-1], np.zeros_like(steps[-1])])
        g[-3:] += np.einsum("dst,td->sd", P, x) + p.T
        at = np.arange(g.shape[1])
        for s, t in np.ndindex(3, 3):
            blocks[s - 3, at, t - 3, at] += P[:, s, t]


def _add_products(
    blocks: Float[np.ndarray, "F D F D"],
    products: Float[np.ndarray, "F F"],
    weights: Float[np.ndarray, "D"],
) -> None:
    at = np.arange(len(weights))
    for s, t in np.argwhere(products):
        blocks[s, at, t, at] += products[s, t] * weights
