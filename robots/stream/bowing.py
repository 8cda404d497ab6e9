"""How a robot's pelvis bows in one frame: `robots.solver.trunk`, in plain numbers.

Of one frame these take a tenth of the time that arrays do. In most frames neither waist nor hips
are asked for more than they can give; where they are, that module says what gives way.
"""

from math import atan2, cos, sin, sqrt

import mujoco
import numpy as np
from jaxtyping import Float

from robots.model.morphology import Morphology
from robots.solver.trunk import (
    ROUNDING,
    bends,
    bowing,
    max_flexion,
    max_lean,
    upright_of,
)
from spark.rig.directions import has_shoulders
from spark.rig.rig import Rig

_LEAST = 1e-6  # of a length and of the half of two directions: below, they have no turn between


class Bowing:
    """Of a robot that follows sources on one rig, over a floor at `floor_z` [m]."""

    def __init__(self, rig: Rig, robot: Morphology, floor_z: float) -> None:
        self._rig, self._robot, self._floor_z = rig, robot, floor_z
        self._has_shoulders = has_shoulders(rig)
        self._upright = upright_of(rig)[0].tolist() if self._has_shoulders else [0.0, 0.0, 1.0]
        self._leans = self._has_shoulders and not bends(robot)
        backwards, forwards = map(float, max_lean(robot))
        self._max_lean, self._max_flexion = (backwards, forwards), float(max_flexion(robot))

    def of(
        self,
        pelvis: Float[np.ndarray, "3 3"],
        trunk: Float[np.ndarray, "3"],
        thighs: Float[np.ndarray, "L 3"],
        joints: Float[np.ndarray, "N 3"],
    ) -> Float[np.ndarray, "3 3"]:
        """How far the robot's pelvis turns, since the T-pose, where that of a source turns by
        `pelvis`, with joints at these places and this way from the hips to the shoulders and along
        the thighs [m]."""
        turned = self._on_waist(pelvis, trunk.tolist())
        if turned is not None and not self._beyond_flexion(turned, thighs.tolist()):
            return turned
        turn, matrix = np.empty(4), np.empty(9)
        mujoco.mju_mat2Quat(turn, pelvis.ravel())
        bowed = bowing(self._rig, self._robot, turn[None], joints[None], self._floor_z)[0]
        mujoco.mju_quat2Mat(matrix, bowed)
        return matrix.reshape(3, 3)

    def _on_waist(
        self, pelvis: Float[np.ndarray, "3 3"], along: list[float]
    ) -> Float[np.ndarray, "3 3"] | None:
        """How the pelvis turns as the waist allows; None where that is not said here."""
        if self._leans:
            return self._leaning(pelvis, along)
        return None if self._has_shoulders and self._beyond_lean(pelvis, along) else pelvis

    def _leaning(
        self, pelvis: Float[np.ndarray, "3 3"], along: list[float]
    ) -> Float[np.ndarray, "3 3"] | None:
        """As `robots.solver.trunk.leaning`; None where the trunk is upside down."""
        (xx, xy, _), (yx, yy, _), _ = pelvis.tolist()
        heading = atan2(yx - xy, xx + yy)
        c, s = cos(heading), sin(heading)
        x, y, z = self._upright
        x, y = c * x - s * y, s * x + c * y
        a, b = sqrt(x * x + y * y + z * z), sqrt(sum(part * part for part in along))
        if min(a, b) < _LEAST:
            return None
        x, y, z = x / a, y / a, z / a
        mx, my, mz = x + along[0] / b, y + along[1] / b, z + along[2] / b
        squared = mx * mx + my * my + mz * mz
        if squared < _LEAST:
            return None
        between, turn, matrix = np.empty(4), np.empty(4), np.empty(9)
        between[:] = squared / 2, y * mz - z * my, z * mx - x * mz, x * my - y * mx
        mujoco.mju_normalize4(between)
        heading_turn = np.array([cos(heading / 2), 0.0, 0.0, sin(heading / 2)])
        mujoco.mju_mulQuat(turn, between, heading_turn)
        mujoco.mju_quat2Mat(matrix, turn)
        return matrix.reshape(3, 3)

    def _beyond_lean(self, pelvis: Float[np.ndarray, "3 3"], along: list[float]) -> bool:
        """Whether the trunk leans against the pelvis as far as a waist allows."""
        (fx, _, ux), (fy, _, uy), (fz, _, uz) = pelvis.tolist()
        x, y, z = along
        bow = atan2(x * fx + y * fy + z * fz, x * ux + y * uy + z * uz)
        bow -= atan2(self._upright[0], self._upright[2])
        backwards, forwards = self._max_lean
        return max(bow - forwards, -bow - backwards) > -ROUNDING

    def _beyond_flexion(self, pelvis: Float[np.ndarray, "3 3"], thighs: list[list[float]]) -> bool:
        """Whether a thigh is raised against the trunk as far as hips flex."""
        (fx, _, ux), (fy, _, uy), (fz, _, uz) = pelvis.tolist()
        raised = (
            atan2(x * fx + y * fy + z * fz, -(x * ux + y * uy + z * uz)) for x, y, z in thighs
        )
        return max(raised, default=-np.inf) - self._max_flexion > -ROUNDING
