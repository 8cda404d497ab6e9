"""From the robot that followed one body to the robot that follows another."""

import mujoco
import numpy as np
from jaxtyping import Float

from robots.model.morphology import Morphology
from spark.kinematics import forward
from spark.rig.feet import sole_positions

_TIME = 0.5  # [s] that the robot takes from the one pose to the other


class Handover:
    """Keeps a robot's coordinates going where what they follow begins anew: the robot stays where
    it stands, on its soles, and takes half a second to its new pose."""

    def __init__(self, robot: Morphology, fps: float) -> None:
        self._robot, self._model = robot, robot.mjcf.model
        base = robot.mjcf.base_qpos
        self._place, self._height = slice(base, base + 2), base + 2
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
        begin, now, end = (self._lowest(qpos) for qpos in (a, out, b))
        out[self._height] += begin + share * (end - begin) - now
        return out

    def _lowest(self, qpos: Float[np.ndarray, "nq"]) -> float:
        """The height of the lowest point of the soles [m]."""
        pose = forward(self._robot.motion(self._robot.from_qpos(qpos[None]), 1.0))
        soles = (sole_positions(sole, *pose)[..., 2].min() for sole in self._robot.soles)
        return float(min(soles, default=qpos[self._height]))
