"""What couples the frames of a stream's window: jerk, the mass's acceleration, and speed.

`robots.solver.smoothness` couples those of whole clips. Without later frames, accelerations that
are held back would lag. So those of the centre of mass are compared with the source's, and what
gives way to feet and floor fades in it. It is expected to go on as its target moves against the
source: a crouch that hips can't follow would else throw it up. Of hinges the jerk is held back,
which leaves an even turn, and an even start of one, as it is. Both reach beyond the newest frame
(`robots.stream.prediction`).
"""

import numpy as np
from jaxtyping import Float

from robots.model.morphology import Morphology
from robots.solver.smoothness import acceleration_weights
from robots.solver.weights import MAX_HINGE_SPEED, W_OVERSPEED
from robots.solver.weights import SMOOTH_CUTOFF as WHOLE_CLIP_CUTOFF
from robots.stream.prediction import Ahead, CostToGo

# [Hz] above which the centre of mass's motion against the source's fades, in x, y and z: its height
# gives way to landings,
COM_CUTOFF = np.array([0.7, 0.7, 1.0])
JERK_CUTOFF = 2.45  # and that of hinges, by their jerk
MAX_ACCELERATION = 40.0  # [m/s²] of the source that the mass goes along with: more is a glitch
_BASE = slice(0, 3)  # dofs of the base's position, in whose place the centre of mass is coupled


class Coupling:
    """Of `free` frames to each other and to the `fixed` ones before them; all weights squared."""

    def __init__(self, robot: Morphology, frame_time: float, *, fixed: int, free: int) -> None:
        whole = acceleration_weights(robot) * (2 * np.pi * WHOLE_CLIP_CUTOFF) ** 2
        mass, hinges = (2 * np.pi * cutoff * frame_time for cutoff in (COM_CUTOFF, JERK_CUTOFF))
        weights = (whole / hinges**3) ** 2
        weights[_BASE] = (whole[_BASE] / mass**2) ** 2
        orders = np.full(len(weights), 3)
        orders[_BASE] = 2
        to_steps = np.diff(np.eye(fixed + free), axis=0)
        self._first = to_steps[:, fixed:]
        self._products = np.zeros((free, free, len(weights)))
        self._to_gradient = np.zeros((free, len(to_steps), len(weights)))
        for order in (2, 3):
            own = orders == order
            over_steps = np.diff(np.eye(len(to_steps)), order - 1, axis=0)
            over_frames = over_steps @ self._first
            self._products[:, :, own] = (over_frames.T @ over_frames)[..., None] * weights[own]
            self._to_gradient[:, :, own] = (over_frames.T @ over_steps)[..., None] * weights[own]
        self._to_go = CostToGo(frame_time, orders, weights)
        self._frame_time = frame_time
        self._overspeed_weight = (W_OVERSPEED / frame_time) ** 2
        self._max_change = MAX_ACCELERATION * frame_time**2
        self.reset()
        self._max_steps = np.full(robot.tree.nv, np.inf)
        hinges = robot.tree.dof_starts[~robot.tree.balls]
        self._max_steps[hinges] = MAX_HINGE_SPEED * frame_time

    def reset(self) -> None:
        """The source has stood still."""
        self._source_steps = np.zeros((len(self._first), 3))

    def follow(self, step: Float[np.ndarray, "3"]) -> None:
        """Take in how far [m] the source's centre of mass has moved with the newest frame."""
        last = self._source_steps[-1]
        change = step - last
        size = max(float(change @ change) ** 0.5, 1e-12)
        step = last + change * min(1.0, self._max_change / size)
        self._source_steps = np.concatenate([self._source_steps[1:], step[None]])

    def overspeed(self, steps: Float[np.ndarray, "V D"]) -> Float[np.ndarray, "V D"]:
        """By how much [rad] hinges turn farther from frame to frame than `MAX_HINGE_SPEED` lets."""
        return steps - np.minimum(np.maximum(steps, -self._max_steps), self._max_steps)

    def add_to(
        self,
        steps: Float[np.ndarray, "V D"],
        com_steps: Float[np.ndarray, "V 3"],
        com_jacobian: Float[np.ndarray, "F 3 D"],
        ahead: Ahead,
        penalty_scale: Float[np.ndarray, "F"],
        blocks: Float[np.ndarray, "F D F D"],
        g: Float[np.ndarray, "F D"],
    ) -> None:
        """Add to the normal equations: `steps` are the dofs' from frame to frame, `com_steps` [m]
        those of the centre of mass, and `ahead` is what is expected of the dofs; `penalty_scale`
        multiplies the weights of overspeed."""
        against = steps.copy()
        against[:, _BASE] = com_steps - self._source_steps
        own_speed = com_jacobian[-1] @ ahead.speeds
        ahead.targets[_BASE] = com_jacobian[-1] @ ahead.targets
        ahead.speeds[_BASE] = own_speed - self._source_steps[-1] / self._frame_time
        P, p = self._to_go.of(ahead)
        before = np.array([-against[-1] - against[-2], -against[-1]])
        products = self._products.copy()
        products[-3:, -3:] += P.transpose(1, 2, 0)
        gradient = np.add.reduce(self._to_gradient * against, axis=1)
        gradient[-3:] += (P[:, :, :2] @ before.T[..., None])[..., 0].T + p.T
        # The mass's place takes that of the base.
        pulled = products[:, :, _BASE].transpose(0, 2, 1)[..., None] * com_jacobian.swapaxes(0, 1)
        moved = com_jacobian.transpose(0, 2, 1)
        blocks += (moved @ pulled.reshape(len(g), 3, -1)).reshape(blocks.shape)
        g += (moved @ gradient[:, _BASE, None])[..., 0]
        products[:, :, _BASE] = gradient[:, _BASE] = 0.0
        diagonals = np.einsum("sdtd->std", blocks)  # a view
        diagonals += products
        g += gradient
        overspeed = self.overspeed(steps)
        if overspeed.any():
            weights = np.full((len(steps), 1), self._overspeed_weight)
            weights[-len(g) :] *= penalty_scale[:, None] ** 2
            g += self._first.T @ (weights * overspeed)
            fast = weights * (overspeed != 0)
            diagonals += np.einsum("vs,vt,vd->std", self._first, self._first, fast)
