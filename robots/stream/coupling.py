"""What couples the frames of a stream's window: accelerations, jerk and speed.

`robots.solver.smoothness` couples those of whole clips. Without later frames, accelerations that
are held back as much would lag. So those of the base are compared with the source's, and what gives
way to feet and floor fades in it; those of hinges are held back less, and their jerk besides, which
leaves an even turn, and an even start of one, as it is.
"""

import numpy as np
from jaxtyping import Float

from robots.model.morphology import Morphology
from robots.solver.smoothness import acceleration_weights
from robots.solver.weights import MAX_HINGE_SPEED, MAX_JERK, W_OVERSPEED
from robots.solver.weights import SMOOTH_CUTOFF as WHOLE_CLIP_CUTOFF

SMOOTH_CUTOFF = 5.5  # [Hz] above which the motion of hinges fades,
BASE_CUTOFF = 2.0  # that of the base's position against the source's,
JERK_CUTOFF = 6.0  # and, by their jerk, that of hinges
_MAX_STIFFENING = 20.0  # of a hinge that is too jerky, as `robots.solver.smoothness` stiffens it


class Coupling:
    """Of `free` frames to each other and to the `fixed` ones before them; all weights squared."""

    def __init__(self, robot: Morphology, frame_time: float, *, fixed: int, free: int) -> None:
        whole = acceleration_weights(robot) * (2 * np.pi * WHOLE_CLIP_CUTOFF) ** 2
        cutoff = np.full(len(whole), 2 * np.pi * SMOOTH_CUTOFF * frame_time)
        cutoff[:3] = 2 * np.pi * BASE_CUTOFF * frame_time
        self._acceleration_weights = (whole / cutoff**2) ** 2
        self._jerk_weights = (whole / (2 * np.pi * JERK_CUTOFF * frame_time) ** 3) ** 2
        self._jerk_weights[:3] = 0.0
        self._overspeed_weight = (W_OVERSPEED / frame_time) ** 2
        self._first, self._second, self._third = (
            np.diff(np.eye(fixed + free), k, axis=0)[:, fixed:] for k in (1, 2, 3)
        )
        self._max_jerk = MAX_JERK * frame_time**3
        self._max_steps = np.full(robot.tree.nv, np.inf)
        hinges = robot.tree.dof_starts[~robot.tree.balls]
        self._max_steps[hinges] = MAX_HINGE_SPEED * frame_time

    def add_to(
        self,
        steps: Float[np.ndarray, "V D"],
        hips: Float[np.ndarray, "T 3"],
        blocks: Float[np.ndarray, "F D F D"],
        g: Float[np.ndarray, "F D"],
    ) -> None:
        """Add to the normal equations: `steps` are the dofs' from frame to frame, `hips` the path
        that the source asks for [m]."""
        accelerations = np.diff(steps, axis=0)
        jerks = np.diff(accelerations, axis=0)
        rms = np.sqrt((jerks**2).mean(axis=0))
        stiffening = np.clip(rms / self._max_jerk, 1.0, _MAX_STIFFENING)
        stiffening[:3] = 1.0
        accelerations[:, :3] -= np.diff(hips, 2, axis=0)
        for differences, values, weights in (
            (self._second, accelerations, self._acceleration_weights * stiffening),
            (self._third, jerks, self._jerk_weights),
        ):
            g += weights * (differences.T @ values)
            _add_products(blocks, differences.T @ differences, weights)
        overspeed = steps - np.clip(steps, -self._max_steps, self._max_steps)
        if overspeed.any():
            g += self._overspeed_weight * (self._first.T @ overspeed)
            fast = self._overspeed_weight * (overspeed != 0)
            for row, weights in zip(self._first, fast, strict=True):
                _add_products(blocks, np.outer(row, row), weights)


def _add_products(
    blocks: Float[np.ndarray, "F D F D"],
    products: Float[np.ndarray, "F F"],
    weights: Float[np.ndarray, "D"],
) -> None:
    at = np.arange(len(weights))
    for s, t in np.argwhere(products):
        blocks[s, at, t, at] += products[s, t] * weights
