"""What the learned start sees of a copied motion and what it says of it, in terms of the parts that
all robots share, so that any robot will do.

All is told in the axes of the parts themselves, or along the heading: turning or moving the whole
motion changes nothing, and the mirror image of a motion has the mirror image of its cues.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from jaxtyping import Float, Int

from robots.footing import Footing, corners_of
from robots.morphology import Morphology
from robots.project import hips_of
from robots.targets import BONES, Targets, side_of
from robots.tree import Frames
from spark.rig import Rig
from spark.roles import Role
from spark.rotation import (
    matrix_from_quat,
    quat_conj,
    quat_from_matrix,
    quat_mul,
    quat_relative,
    quat_rotate,
    rotvec_from_quat,
)

_LIMBS = ("upper_leg", "lower_leg", "foot", "upper_arm", "forearm", "hand")
PARTS = (Role.PELVIS, Role.SPINE, *(Role(f"{s}_{p}") for s in ("left", "right") for p in _LIMBS))
_ABOVE = (-1, 0, 0, 2, 3, 1, 5, 6, 0, 8, 9, 1, 11, 12)  # the part that each hangs on
_OTHER = np.array([0, 1, 8, 9, 10, 11, 12, 13, 2, 3, 4, 5, 6, 7])  # on the other side of the body
_BONES = tuple(PARTS.index(role) for role, _ in BONES)
_BONES_OTHER = np.array([_BONES.index(int(_OTHER[k])) for k in _BONES])
_FEET_OTHER = np.array([2, 3, 0, 1])  # left heel, left toe, right heel, right toe
_POLAR, _AXIAL, _PLAIN = np.array([1.0, -1, 1]), np.array([-1.0, 1, -1]), np.ones(1)
_HASTE = 0.3  # [s] for which hips go on, to be as large as other cues

_LAYOUT = (  # what is seen: in a mirror what is where, and which of its coordinates turn around
    (_OTHER, _AXIAL),  # how each part would have to turn to be as wanted [rad]
    (_OTHER, _POLAR),  # where up is
    (_OTHER[1:] - 1, _POLAR),  # where a part's front is, seen from the part that it hangs on
    (_OTHER[1:] - 1, _POLAR),  # where its top is
    (_BONES_OTHER, _POLAR),  # from where bones point to where they should
    (_FEET_OTHER, _POLAR),  # from heels and toes that stand to where they should [hip heights]
    (_FEET_OTHER, _PLAIN),  # how high heels and toes are [hip heights]
    (_FEET_OTHER, _PLAIN),  # how firmly they should be on the floor
    (_FEET_OTHER, _PLAIN),  # how firmly in one place
    (np.zeros(1, dtype=np.int64), _POLAR),  # the hips' velocity [hip heights / s], scaled
    (np.zeros(1, dtype=np.int64), _PLAIN),  # how high they are [hip heights]
)
_ANSWER = ((_OTHER, _AXIAL), (np.zeros(1, dtype=np.int64), _POLAR))


@dataclass(frozen=True, eq=False)
class Pose:
    """How a robot stands over frames: the rotations of `PARTS` since the T-pose, the middle of the
    hips [m], and the rotations of all joints in the world. What a robot lacks turns like what it
    would hang on."""

    parts: Float[np.ndarray, "T 14 4"]
    hips: Float[np.ndarray, "T 3"]
    world: Float[np.ndarray, "T J 4"]


def joints_of(rig: Rig) -> tuple[int | None, ...]:
    """The joint of the rig for each of `PARTS`; of the spine, the topmost."""
    return tuple(rig.chest if p is Role.SPINE else rig.roles.joint(p) for p in PARTS)


def pose_of(robot: Morphology, frames: Frames) -> Pose:
    """How the robot stands where its links are."""
    rig = robot.rig
    world = quat_from_matrix(np.moveaxis(frames.turns[robot.links], -1, 0))
    joints: list[int] = []
    for j, above in zip(joints_of(rig), _ABOVE, strict=True):
        joints.append(joints[above] if j is None else j)
    parts = quat_mul(world[:, joints], quat_conj(rig.tpose[joints]))
    return Pose(parts, hips_of(robot, frames), world)


def cues_of(
    robot: Morphology,
    targets: Targets,
    footing: Sequence[Footing],
    frames: Frames,
    pose: Pose,
) -> Float[np.ndarray, "T C"]:
    """What is seen of a pose: how it stands, and how far it is from what is wanted."""
    rig, height, count = robot.rig, robot.rig.hip_height, len(pose.hips)
    joints, back = joints_of(rig), quat_conj(pose.parts)
    miss = np.zeros((count, len(PARTS), 3))
    for k, j in enumerate(joints):
        if j is not None:
            world = targets.chest if PARTS[k] is Role.SPINE else targets.world[:, j]
            wanted = quat_mul(world, quat_conj(rig.tpose[j]))
            miss[:, k] = rotvec_from_quat(quat_relative(pose.parts[:, k], wanted))
    turned = matrix_from_quat(quat_relative(pose.parts[:, _ABOVE[1:]], pose.parts[:, 1:]))
    bones = np.zeros((count, len(BONES), 3))
    for b, ((role, _), k) in enumerate(zip(BONES, _BONES, strict=True)):
        j = joints[k]
        if j is not None and role in targets.bones and role in robot.bones:
            own = quat_rotate(rig.tpose[j], robot.bones[role])
            bones[:, b] = quat_rotate(back[:, k], targets.bones[role]) - own
    heading = _heading(pose)
    velocity = np.gradient(pose.hips, targets.frame_time, axis=0) if count > 1 else 0 * pose.hips
    seen = (
        miss,
        quat_rotate(back, np.array([0.0, 0.0, 1.0])),
        turned[..., 0],
        turned[..., 2],
        bones,
        *_feet(robot, footing, frames, heading),
        quat_rotate(quat_conj(heading), velocity)[:, None] * _HASTE / height,
        pose.hips[:, 2:] / height,
    )
    return np.concatenate([cue.reshape(count, -1) for cue in seen], axis=1)


def answer_of(pose: Pose, other: Pose, height: float) -> Float[np.ndarray, "T A"]:
    """What takes one pose to another: rotation vectors in the parts' own axes [rad], and the hips'
    way along the heading [hip heights]."""
    turns = rotvec_from_quat(quat_relative(pose.parts, other.parts))
    way = quat_rotate(quat_conj(_heading(pose)), other.hips - pose.hips) / height
    return np.concatenate([turns.reshape(len(way), -1), way], axis=1)


def read_answer(
    pose: Pose, answer: Float[np.ndarray, "T A"], height: float
) -> tuple[Float[np.ndarray, "T 14 3"], Float[np.ndarray, "T 3"]]:
    """The rotation vectors [rad] and the hips' new path [m] that an answer says."""
    turns = answer[:, :-3].reshape(len(answer), len(PARTS), 3)
    return turns, pose.hips + quat_rotate(_heading(pose), answer[:, -3:]) * height


def cue_mirror() -> tuple[Int[np.ndarray, "C"], Float[np.ndarray, "C"]]:
    """The mirror image of cues: which to take, and their signs."""
    return _mirror(_LAYOUT)


def answer_mirror() -> tuple[Int[np.ndarray, "A"], Float[np.ndarray, "A"]]:
    """The mirror image of answers."""
    return _mirror(_ANSWER)


def _mirror(
    layout: Sequence[tuple[Int[np.ndarray, "_"], Float[np.ndarray, "_"]]],
) -> tuple[Int[np.ndarray, "C"], Float[np.ndarray, "C"]]:
    sizes = [len(other) * len(signs) for other, signs in layout]
    order = [
        start + (other[:, None] * len(signs) + np.arange(len(signs))).ravel()
        for start, (other, signs) in zip(accumulate(sizes, initial=0), layout, strict=False)
    ]
    return np.concatenate(order), np.concatenate([np.tile(s, len(o)) for o, s in layout])


def _heading(pose: Pose) -> Float[np.ndarray, "T 4"]:
    """The part of the pelvis' rotation that is about the vertical."""
    upright = pose.parts[:, 0] * np.array([1.0, 0, 0, 1])
    length = np.linalg.norm(upright, axis=1, keepdims=True)
    return np.where(length > 1e-6, upright / np.maximum(length, 1e-6), [1.0, 0, 0, 0])


def _feet(
    robot: Morphology, footing: Sequence[Footing], frames: Frames, heading: Float[np.ndarray, "T 4"]
) -> tuple[
    Float[np.ndarray, "T 4 3"],
    Float[np.ndarray, "T 4"],
    Float[np.ndarray, "T 4"],
    Float[np.ndarray, "T 4"],
]:
    """Of heels and toes: the way to where they should stand, their heights, how firmly they are to
    be on the floor, and how firmly in one place."""
    away = np.zeros((len(heading), 4, 3))
    heights, low, still = np.zeros((3, len(heading), 4))
    back = quat_conj(heading)
    for sole, foot in zip(robot.soles, footing, strict=True):
        corners = corners_of(frames, sole) / robot.rig.hip_height
        places = foot.places / robot.rig.hip_height
        for end in range(2):
            k = end + (0 if side_of(robot, sole) == "left" else 2)
            here = slice(2 * end, 2 * end + 2)
            way = ((places - corners) * foot.holds)[here].mean(0).T
            away[:, k] = quat_rotate(back, way)
            heights[:, k] = corners[here, 2].mean(0)
            still[:, k], low[:, k] = foot.holds[2 * end, 0], foot.holds[2 * end, 2]
    return away, heights, low, still
