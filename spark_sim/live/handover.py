"""From the robot that followed one body to the robot that follows another."""

import mujoco
import numpy as np
from jaxtyping import Float

from robots.model.mjcf import Mjcf

_TIME = 0.5  # [s] that the robot takes from the one pose to the other


class Handover:
    """Keeps a robot's coordinates going where what they follow begins anew: the robot stays where
    it stands, and takes half a second to its new pose."""

    def __init__(self, robot: Mjcf, fps: float) -> None:
        self._model = robot.model
        base = int(robot.model.jnt_qposadr[robot.free_joint])
        self._place = slice(base, base + 2)
        self._steps = max(round(_TIME * fps), 1)
        self._last: Float[np.ndarray, nq] | None = None
        self._before: Float[np.ndarray, nq] | None = None
        self._shift = np.zeros(2)
        self._done = 0

    def begin(self) -> None:
        """What comes next follows another body."""
        if self._last is not None:
            self._before, self._done = self._last, 0

    def follow(self, qpos: Float[np.ndarray, "nq"]) -> Float[np.ndarray, "nq"]:
        """The robot's coordinates, for those that the solver gave."""
        if self._before is not None and self._done == 0:
            self._shift = self._before[self._place] - qpos[self._place]
        qpos = qpos.copy()
        qpos[self._place] += self._shift
        if self._before is not None:
            self._done += 1
            share = self._done / self._steps
            if share >= 1:
                self._before = None
            else:
                qpos = self._between(self._before, qpos, share * share * (3 - 2 * share))
        self._last = qpos
        return qpos

    def _between(
        self, a: Float[np.ndarray, "nq"], b: Float[np.ndarray, "nq"], share: float
    ) -> Float[np.ndarray, "nq"]:
        out, way = a.copy(), np.zeros(self._model.nv)
        mujoco.mj_differentiatePos(self._model, way, 1.0, a, b)
        mujoco.mj_integratePos(self._model, out, way, share)
        return out
