"""How a robot would stand if its parts turned as the source's do."""

from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float

from robots.model.morphology import Morphology
from robots.stream.bowing import Bowing
from robots.stream.carried_points import place
from robots.stream.source_points import SourcePoints
from spark.rig.rig import Rig
from spark.rotation import matrix_from_quat, quat_conj
from spark.transfer.analytic import correspond

_UNTURNED = np.eye(3)


class Copied(NamedTuple):
    """Rotations (`R_world_joint`) of the joints of a robot's rig and of its chest, and where the
    points of its soles would be: from the middle of its toes along the foot and to its left, and
    above the lowest of them [m]."""

    world: Float[np.ndarray, "J 3 3"]
    chest: Float[np.ndarray, "3 3"]
    pitched: Float[np.ndarray, "P 3"]


class Copier:
    """Of sources on one rig onto one robot, over a floor at `floor_z` [m]."""

    def __init__(self, source: Rig, robot: Morphology, floor_z: float) -> None:
        self._bowing = Bowing(source, robot, floor_z)
        self._untpose = matrix_from_quat(quat_conj(source.tpose))
        tpose, rig = matrix_from_quat(robot.rig.tpose), robot.rig
        self._pelvis, self._chest, self._pelvis_tpose = rig.pelvis, source.chest, tpose[rig.pelvis]
        self._chest_tpose = self._untpose[source.chest] @ tpose[rig.chest]
        ways = correspond(source, rig)
        self._first = ways.first
        self._to_own = self._untpose[ways.first] @ tpose
        self._at_rest = np.flatnonzero(ways.first < 0)
        self._between = [
            (j, int(ways.first[j]), int(ways.second[j]), float(ways.mix[j]), tpose[j])
            for j in np.flatnonzero((ways.mix != 0) & (ways.first >= 0)).tolist()
        ]
        self._index_soles(robot)

    def of(
        self,
        world: Float[np.ndarray, "N 3 3"],
        joints: Float[np.ndarray, "N 3"],
        points: SourcePoints,
    ) -> Copied:
        """Of a source with these rotations and places [m] of its joints, and these points."""
        own = world.take(self._first, axis=0) @ self._to_own
        for j, first, second, mix, tpose in self._between:
            own[j] = self._mixed(world, first, second, mix) @ tpose
        own[self._at_rest] = _UNTURNED
        pelvis = own[self._pelvis] @ self._pelvis_tpose.T
        bowed = self._bowing.of(pelvis, points.trunk, points.thighs, joints)
        if bowed is not pelvis:
            own[self._pelvis] = bowed @ self._pelvis_tpose
        return Copied(own, world[self._chest] @ self._chest_tpose, self._pitched(own))

    def _mixed(
        self, world: Float[np.ndarray, "N 3 3"], first: int, second: int, mix: float
    ) -> Float[np.ndarray, "3 3"]:
        """The turn since the T-pose between those of two joints: as `Correspondence.rotations`."""
        a, b, rotvec, matrix = np.empty(4), np.empty(4), np.empty(3), np.empty(9)
        mujoco.mju_mat2Quat(a, (world[first] @ self._untpose[first]).ravel())
        mujoco.mju_mat2Quat(b, (world[second] @ self._untpose[second]).ravel())
        mujoco.mju_subQuat(rotvec, b, a)
        mujoco.mju_quatIntegrate(a, rotvec, mix)
        mujoco.mju_quat2Mat(matrix, a)
        return matrix.reshape(3, 3)

    def _pitched(self, world: Float[np.ndarray, "J 3 3"]) -> Float[np.ndarray, "P 3"]:
        if not len(self._sole):
            return np.zeros((0, 3))
        arms = self._sole_rows @ world.transpose(0, 2, 1).reshape(-1, 3)
        over_floor = arms[:, :2].view(np.complex128)[:, 0]
        over, feet = arms[: len(self._sole)], over_floor[len(self._sole) :]
        headings = feet.conj() / np.maximum(np.abs(feet), 1e-9)
        over_floor[: len(over)] *= headings.take(self._sole)
        over[:, 2] -= np.minimum.reduceat(over[:, 2], self._sole_starts).take(self._sole)
        return over

    def _index_soles(self, robot: Morphology) -> None:
        """The points of the soles from the middle of the toes, and that from the heel's, by what
        the joints' turns have to do with them."""
        rest, count = robot.rig.skeleton.rest_positions, len(robot.rig.skeleton)
        counts = [len(sole) for sole in robot.soles]
        self._sole = np.repeat(np.arange(len(counts)), counts)
        self._sole_starts = np.cumsum([0, *counts], dtype=int)[:-1]
        rows, feet = [np.zeros((0, 3 * count))], [np.zeros((0, 3 * count))]
        for sole in robot.soles:
            from_foot = rest[sole.joints] - rest[sole.foot]
            own = np.array(
                [
                    place(count, sole.foot, above) + place(count, int(joint), arm)
                    for joint, above, arm in zip(sole.joints, from_foot, sole.offsets, strict=True)
                ]
            )[:, count:]
            heel, toe = own[:2].mean(0), own[-2:].mean(0)
            rows.append(own - toe)
            feet.append((toe - heel)[None])
        self._sole_rows = np.concatenate(rows + feet)
