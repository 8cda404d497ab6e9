"""One frame of a source as a robot's targets: what `robots.solver.targets` makes of a clip, without
what needs the whole clip, in a tenth of its time."""

from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float, Int

from robots.model.morphology import Morphology
from robots.solver.contacts import MAY_TOUCH, has_feet, touching_joint
from robots.solver.noise import Noise, without_noise
from robots.solver.targets import (
    LIMB_SEGMENTS,
    TPOSE_DIRECTIONS,
    arm_length,
    palm_thickness,
    source_feet,
)
from robots.solver.touching import touches_of
from robots.solver.trunk import bowing
from robots.solver.window_targets import PoseTargets
from robots.stream.source_poses import SourcePoses
from spark.errors import FrameError
from spark.rig.contacts import standing_heights
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rig.segments import segments
from spark.rotation import matrix_from_quat, quat_conj
from spark.transfer.analytic import correspond
from spark.transfer.canonical import CanonicalMotion, canonical_positions

LATENCY = 2  # [frames] between the newest frame of a stream and its answer
_MAX_NORM_ERROR = 0.05  # of a quaternion: beyond, it is not one that was merely rounded


class Frame(NamedTuple):
    """One frame of a source, as `spark.motion.Motion` has them: the root's place [m, world, Z up],
    local rotations (`q_parent_joint`, wxyz) of all joints and, where these move against their
    parents, all joints' local places [m]."""

    root_pos: Float[np.ndarray, "3"]
    rotations: Float[np.ndarray, "N 4"]
    translations: Float[np.ndarray, "N 3"] | None = None


@dataclass(frozen=True, eq=False)
class Ground:
    """The floor under a clip: its height `z` [m], and the lowest heights [m] of heel and toe of the
    feet that the robot's soles follow (1st percentile); and the clip's noise, where contacts don't
    bear it."""

    z: float
    low: Float[np.ndarray, "S 2"]
    noise: Noise | None = None


@dataclass(frozen=True, eq=False)
class FrameTargets(PoseTargets):
    """`robots.solver.targets.Targets` of one frame, or of some (T).

    `bones` are in the order of `FrameReader.bones`. `com` is the source's centre of mass, scaled.
    `feet` are the source's heel and toe of each of the robot's soles [m, the source's own world],
    `clearance` is how high its soles are, scaled, and `pitched` where the points of the robot's
    would be: from the middle of its toes along the foot and to its left, and above the lowest of
    them [m]. `parts` are its joints that may touch the ground, in the order of `FrameReader.parts`
    [m, the source's own world].
    """

    com: Float[np.ndarray, "*T 3"]
    feet: Float[np.ndarray, "*T S 2 3"]
    clearance: Float[np.ndarray, "*T S"]
    pitched: Float[np.ndarray, "*T P 3"]
    parts: Float[np.ndarray, "*T K 3"]


def raised(targets: FrameTargets, by: float) -> FrameTargets:
    """The targets of a body that is higher by so much [m]."""
    up = np.array([0.0, 0.0, by])
    return replace(
        targets,
        hips=targets.hips + up,
        com=targets.com + up,
        clearance=targets.clearance + by,
    )


def repeated(targets: FrameTargets, count: int) -> FrameTargets:
    """Those of one frame, of so many frames like it."""
    parts = (getattr(targets, field.name) for field in fields(FrameTargets))
    return FrameTargets(*(np.repeat(part[None], count, axis=0) for part in parts))


def move_on(targets: FrameTargets, newest: FrameTargets) -> None:
    """Take the targets of some frames on by one, in place."""
    for name, part in vars(targets).items():
        part[:-1] = part[1:]
        part[-1] = getattr(newest, name)


def ground_of(source: CanonicalMotion, robot: Morphology) -> Ground:
    """The floor of a clip; of a T-pose alone, its soles' height."""
    source, noise, _ = without_noise(source)
    feet = source_feet(source, canonical_positions(source), robot)
    exist, low = has_feet(feet), np.zeros(feet.shape[1:3])
    if exist.any():
        low[exist] = standing_heights(feet[:, exist], source.rig.standing_height)
    return Ground(source.floor_z, low, noise)


def parts_of(source: Rig, robot: Morphology) -> tuple[list[Role], Int[np.ndarray, "K"]]:
    """The parts of both that may touch the ground, and the source's joints of them."""
    found = {role: touching_joint(source, role) for role in MAY_TOUCH if role in touches_of(robot)}
    joints = {role: joint for role, joint in found.items() if joint is not None}
    return list(joints), np.array(list(joints.values()), dtype=int)


class FrameReader:
    """Turns frames of motions on one rig into targets for one robot."""

    def __init__(self, source: Rig, robot: Morphology, ground: Ground) -> None:
        self.source, self.robot, self.ground = source, robot, ground
        self.scale = robot.rig.hip_height / source.hip_height
        self._poses = SourcePoses(source.skeleton)
        self._untpose = matrix_from_quat(quat_conj(source.tpose))
        self._tpose = matrix_from_quat(robot.rig.tpose)
        self._chest = source.chest
        self._segments = segments(source)
        self._correspondence = correspond(source, robot.rig)
        self._at_rest = np.flatnonzero(self._correspondence.first < 0)
        self._interpolated = np.flatnonzero(
            (self._correspondence.mix != 0) & (self._correspondence.first >= 0)
        )
        self._index_feet()
        self._index_bones()
        self._index_hands()
        self.parts, self._part_joints = parts_of(source, robot)

    def targets(self, frame: Frame) -> FrameTargets:
        """The targets that a frame sets for the robot.

        Raises `FrameError` where it is not a frame of the source's skeleton.
        """
        world, joints = self._world(frame)
        turns = world @ self._untpose
        bones = joints[self._lower] - joints[self._upper]
        bones /= np.maximum(np.sqrt((bones * bones).sum(1, keepdims=True)), 1e-12)
        for row, joint, out in self._by_rotation:
            bones[row] = turns[joint] @ out
        hips = joints[self.source.hips].mean(0)
        hips[2] -= self.ground.z
        hips *= self.scale
        own = self._own(turns)
        pelvis, places = self.robot.rig.pelvis, joints[None]
        turn, matrix = np.empty(4), np.empty(9)
        mujoco.mju_mat2Quat(turn, own[pelvis].ravel())
        bowed = bowing(self.source, self.robot, turn[None], places, self.ground.z)[0]
        mujoco.mju_quat2Mat(matrix, bowed)
        own[pelvis] = matrix.reshape(3, 3)
        own_world = own @ self._tpose
        return FrameTargets(
            world=own_world,
            chest=turns[self._chest] @ self._tpose[self.robot.rig.chest],
            hips=hips,
            com=self._com(world, joints),
            bones=bones,
            hands=self._between_hands(joints),
            feet=self._feet(world, joints),
            clearance=self._clearance(world, joints),
            pitched=self._pitched(own_world),
            parts=joints[self._part_joints],
        )

    def _world(self, frame: Frame) -> tuple[Float[np.ndarray, "N 3 3"], Float[np.ndarray, "N 3"]]:
        """Rotations and places [m] of the source's joints."""
        root, rotations, translations = Frame(*frame)
        names, offsets = self.source.skeleton.names, self.source.skeleton.offsets
        local = offsets if translations is None else translations
        for what, array, like in (
            ("root_pos", root, offsets[0]),
            ("rotations", rotations, self.source.tpose),
            ("translations", local, offsets),
        ):
            if np.shape(array) != like.shape:
                raise FrameError(
                    f"{what} has shape {np.shape(array)}; expected {like.shape}, as the source's "
                    "skeleton has it"
                )
            if not np.isfinite(array).all():
                where = f" of joint {names[_first_bad(array)]!r}" * (like.ndim - 1)
                raise FrameError(f"{what}{where} is not finite; leave the frame out")
        length = np.sqrt((rotations * rotations).sum(1))
        if np.abs(length - 1).max() > _MAX_NORM_ERROR:
            j = int(np.abs(length - 1).argmax())
            raise FrameError(
                f"the quaternion of joint {names[j]!r} has length {length[j]:.3g}; expected 1"
            )
        return self._poses.of(root, rotations / length[:, None], local)

    def _com(
        self, world: Float[np.ndarray, "N 3 3"], joints: Float[np.ndarray, "N 3"]
    ) -> Float[np.ndarray, "3"]:
        own = self._segments
        places = joints[own.joints] + (world[own.joints] @ own.coms[:, :, None])[..., 0]
        com: Float[np.ndarray, 3] = self.scale * (own.masses @ places)
        return com

    def _own(self, turns: Float[np.ndarray, "N 3 3"]) -> Float[np.ndarray, "J 3 3"]:
        """How the robot's joints turn since the T-pose: as `Correspondence.rotations` says."""
        first, second, mix = (
            self._correspondence.first,
            self._correspondence.second,
            self._correspondence.mix,
        )
        out = turns[first]
        for j in self._interpolated.tolist():
            a, b, rotvec, matrix = np.empty(4), np.empty(4), np.empty(3), np.empty(9)
            mujoco.mju_mat2Quat(a, turns[first[j]].ravel())
            mujoco.mju_mat2Quat(b, turns[second[j]].ravel())
            mujoco.mju_subQuat(rotvec, b, a)
            mujoco.mju_quatIntegrate(a, rotvec, mix[j])
            mujoco.mju_quat2Mat(matrix, a)
            out[j] = matrix.reshape(3, 3)
        out[self._at_rest] = self._tpose[self._at_rest].transpose(0, 2, 1)
        return out

    def _feet(
        self, world: Float[np.ndarray, "N 3 3"], joints: Float[np.ndarray, "N 3"]
    ) -> Float[np.ndarray, "S 2 3"]:
        feet = np.zeros((len(self.has_feet), 2, 3))
        heels = (world[self._heels] @ self._heel_offsets[:, :, None])[..., 0]
        feet[self.has_feet, 0] = joints[self._heels] + heels
        feet[self.has_feet, 1] = joints[self._toes]
        return feet

    def _clearance(
        self, world: Float[np.ndarray, "N 3 3"], joints: Float[np.ndarray, "N 3"]
    ) -> Float[np.ndarray, "S"]:
        out = np.zeros(len(self.has_feet))
        for s, (own, offsets) in zip(np.flatnonzero(self.has_feet), self._soles, strict=True):
            heights = joints[own, 2] + (world[own, 2] * offsets).sum(1)
            out[s] = self.scale * (heights.min() - self.ground.z)
        return out

    def _pitched(self, world: Float[np.ndarray, "J 3 3"]) -> Float[np.ndarray, "P 3"]:
        out = []
        for sole, from_foot in zip(self.robot.soles, self._from_foot, strict=True):
            points = from_foot @ world[sole.foot].T
            points += (world[sole.joints] @ sole.offsets[:, :, None])[..., 0]
            toe = points[-2:, :2].mean(0)
            x, y = toe - points[:2, :2].mean(0)
            along, across = np.array([[x, y], [-y, x]]) / max(np.hypot(x, y), 1e-9)
            over = points[:, :2] - toe
            out.append(
                np.column_stack([over @ along, over @ across, points[:, 2] - points[:, 2].min()])
            )
        return np.concatenate(out) if out else np.zeros((0, 3))

    def _between_hands(self, joints: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "3"]:
        if self.hands is None:
            return np.zeros(3)
        (left, right), scale, least = self.hands
        between = scale * (joints[left] - joints[right])
        distance = float(np.sqrt(between @ between))
        return between * (max(distance, least) / max(distance, 1e-9))

    def _index_feet(self) -> None:
        """The source's heels and toes that the robot's soles follow."""
        source, robot = self.source, self.robot
        source_soles = {sole.side: sole for sole in source.soles}
        sides = [sole.side for sole in robot.soles]
        rest = robot.rig.skeleton.rest_positions
        self._from_foot = [rest[sole.joints] - rest[sole.foot] for sole in robot.soles]
        self._soles = [
            (own.joints, own.offsets)
            for own in (source_soles[side] for side in sides if side in source_soles)
        ]
        self.has_feet = np.array([side in source_soles for side in sides], dtype=bool)
        heels, offsets, toes = [], [], []
        for side in (side for side in sides if side in source_soles):
            foot, toe = source.roles.require(Role(f"{side}_foot")), Role(f"{side}_toe")
            heels.append(foot)
            offsets.append(source_soles[side].offsets[:2].mean(0))
            toes.append(next(iter(source.roles.joints(toe)), foot))
        self._heels, self._toes = np.array(heels, dtype=int), np.array(toes, dtype=int)
        self._heel_offsets = np.array(offsets).reshape(-1, 3)

    def _index_bones(self) -> None:
        """The segments of the limbs that both have, and between which joints they point; where the
        far one is missing, the rotation says it."""
        roles, rest = self.source.roles, self.source.skeleton.rest_positions
        self.bones: list[Role] = []
        upper, lower, self._by_rotation = [], [], []
        for role, far in LIMB_SEGMENTS:
            a, b = roles.joint(role), roles.joint(far)
            if a is None or role not in self.robot.bones:
                continue
            if b is None or np.linalg.norm(rest[b] - rest[a]) < 1e-6:
                self._by_rotation.append((len(self.bones), a, TPOSE_DIRECTIONS[role]))
                b = a
            self.bones.append(role)
            upper.append(a)
            lower.append(b)
        self._upper, self._lower = np.array(upper, dtype=int), np.array(lower, dtype=int)

    def _index_hands(self) -> None:
        """The wrists of a source and a robot that have both, in which scale, and how near [m] the
        robot's may come."""
        roles = (Role.LEFT_HAND, Role.RIGHT_HAND)
        source_soles = [self.source.roles.joint(role) for role in roles]
        own = [self.robot.rig.roles.joint(role) for role in roles]
        self.hands: tuple[list[int], float, float] | None = None
        if None not in (*source_soles, *own):
            scale = arm_length(self.robot.rig) / arm_length(self.source)
            least = sum(palm_thickness(self.robot, role) for role in roles)
            self.hands = [int(j) for j in source_soles if j is not None], scale, least


def _first_bad(values: Float[np.ndarray, "N *D"]) -> int:
    return int(np.flatnonzero(~np.isfinite(values).reshape(len(values), -1).all(1))[0])
