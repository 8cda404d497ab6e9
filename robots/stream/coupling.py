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
_TURN = slice(3, 6)  # of its rotation: smoothed as in whole clips it would lag, and feet slide
_OTHERS = slice(3, None)


class Coupling:
    """Of `free` frames to each other and to the `fixed` ones before them; all weights squared."""

    def __init__(self, robot: Morphology, frame_time: float, *, fixed: int, free: int) -> None:
        whole = acceleration_weights(robot) * (2 * np.pi * WHOLE_CLIP_CUTOFF) ** 2
        whole[_TURN] = 1.0
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

    def set_in_motion(self, step: Float[np.ndarray, "3"]) -> None:
        """The source's centre of mass has moved so far [m] in each frame."""
        self._source_steps[:] = step

    def follow(self, step: Float[np.ndarray, "3"]) -> None:
        """Take in how far [m] the source's centre of mass has moved with the newest frame."""
        last = self._source_steps[-1]
        change = step - last
        size = max(float(change @ change) ** 0.5, 1e-12)
        step = last + change * min(1.0, self._max_change / size)
        self._source_steps = np.concatenate([self._source_steps[1:], step[None]])

    def overspeed(self, steps: Float[np.ndarray, "V D"]) -> Float[np.ndarray, "V D"]:
        """By how much [rad] hinges turn farther from frame to frame than `MAX_HINGE_SPEED` lets;
        below 0 where they don't."""
        return np.abs(steps) - self._max_steps

    def normal_equations(
        self,
        steps: Float[np.ndarray, "V D"],
        com_steps: Float[np.ndarray, "V 3"],
        com_jacobian: Float[np.ndarray, "F 3 D"],
        ahead: Ahead,
        penalty_scale: Float[np.ndarray, "F"],
    ) -> tuple[Float[np.ndarray, "F D F D"], Float[np.ndarray, "F D"]]:
        """H and g: `steps` are the dofs' from frame to frame, `com_steps` [m] those of the centre
        of mass, and `ahead` is what is expected of the dofs; `penalty_scale` multiplies the weights
        of overspeed."""
        against = steps.copy()
        against[:, _BASE] = com_steps - self._source_steps
        cost = self._to_go.of(ahead.weights)
        products = self._products.copy()
        products[-3:, -3:] += cost[:, :3]
        gradient = np.add.reduce(self._to_gradient * against, axis=1)
        gradient[-3:] += np.add.reduce(cost * self._expected(against, com_jacobian[-1], ahead), 1)
        # The mass's place takes that of the base.
        moved = com_jacobian.transpose(0, 2, 1)
        pulled = products[:, :, _BASE].transpose(0, 2, 1)[..., None] * com_jacobian.swapaxes(0, 1)
        shape = (*gradient.shape, *gradient.shape)
        blocks = (moved @ pulled.reshape(len(gradient), 3, -1)).reshape(shape)
        g: Float[np.ndarray, "F D"] = (moved @ gradient[:, _BASE, None])[..., 0]
        diagonals = np.einsum("sdtd->std", blocks)  # a view
        diagonals[..., _OTHERS] += products[..., _OTHERS]
        g[:, _OTHERS] += gradient[:, _OTHERS]
        overspeed = self.overspeed(steps)
        if np.maximum.reduce(overspeed, axis=None) > 0:
            weights = np.full((len(steps), 1), self._overspeed_weight)
            weights[-len(g) :] *= penalty_scale[:, None] ** 2
            beyond = np.copysign(np.maximum(overspeed, 0.0), steps)
            g += self._first.T @ (weights * beyond)
            fast = weights * (overspeed > 0)
            diagonals += np.einsum("vs,vt,vd->std", self._first, self._first, fast)
        return blocks, g

    def _expected(
        self,
        against: Float[np.ndarray, "V D"],
        com_jacobian: Float[np.ndarray, "3 D"],
        ahead: Ahead,
    ) -> Float[np.ndarray, "5 D"]:
        """The last three values, from the newest, and where the target is and how fast it moves."""
        out = np.zeros((5, against.shape[1]))
        np.negative(against[-1], out=out[1])
        np.subtract(out[1], against[-2], out=out[0])
        out[3], out[4] = ahead.targets, ahead.speeds
        out[3:, _BASE] = out[3:] @ com_jacobian.T
        out[4, _BASE] -= self._source_steps[-1] / self._frame_time
        return out
