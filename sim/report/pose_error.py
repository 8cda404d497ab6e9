"""The pose beside the source's: by what angles the parts of the two bodies point apart."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from sim.trajectory import Subject
from spark.blocks import in_blocks
from spark.kinematics import forward
from spark.motion import Motion
from spark.resample import motion_at
from spark.rig.directions import bone_directions, has_shoulders, hips_to_shoulders
from spark.rig.rig import Rig
from spark.rig.roles import HANDS, Role
from spark.rotation import quat_conj, quat_mul, quat_rotate
from spark.summary import brief

FAR = np.radians(45)  # of a part: it points elsewhere
_AHEAD = np.array([1.0, 0.0, 0.0])
_LOOKING = (Role.LEFT_FOOT, Role.RIGHT_FOOT, Role.HEAD)


class Part(NamedTuple):
    """A part of a body: its name, and its `kind`: "limb", "trunk", "foot", "head" or "hand"."""

    name: str
    kind: str


@dataclass(frozen=True, eq=False)
class PoseError:
    """`angles[t, k]` [rad]: between the k-th of `parts` of a motion and of its source, in the
    world, of the parts that both bodies have.

    Of a limb's segment and of the trunk, from the hips to the shoulders, it is the angle between
    where the two point; of feet and head, between where those look that look ahead in the T-pose;
    of hands, the whole of the turn by which one is turned from the other since the T-pose.
    """

    parts: tuple[Part, ...]
    angles: Float[np.ndarray, "T K"]

    __repr__ = brief

    @property
    def mean(self) -> float:
        """Over all parts and frames [rad]."""
        return float(self.angles.mean())

    @property
    def far(self) -> Bool[np.ndarray, "T K"]:
        """Where a part points elsewhere."""
        return self.angles > FAR

    @property
    def means(self) -> Float[np.ndarray, "K"]:
        """Each part's over the frames [rad]."""
        return self.angles.mean(axis=0)

    def mean_of(self, kind: str) -> float | None:
        """Over the parts of a kind [rad]; None where the two bodies share none."""
        own = [k for k, part in enumerate(self.parts) if part.kind == kind]
        return float(self.angles[:, own].mean()) if own else None


def pose_error(
    subject: Subject, source: Subject, times: Float[np.ndarray, "T"]
) -> PoseError | None:
    """Of a motion whose frames lie at `times` [s] of its source; None where they share no part."""
    motion, theirs = subject.motion, source.motion
    one, other = (
        _pointing(each.motion.picked(slice(0, 1)), each.rig) for each in (subject, source)
    )
    parts = tuple(part for part in one if part in other)
    if not parts:
        return None

    def apart(block: slice) -> Float[np.ndarray, "T K"]:
        at = times[block] / theirs.frame_time
        wanted = _pointing(motion_at(theirs, at, motion.frame_time), source.rig)
        found = _pointing(motion.picked(block), subject.rig)
        return np.stack([_between(wanted[part], found[part]) for part in parts], axis=1)

    return PoseError(parts, in_blocks(apart, len(motion)))


def _pointing(motion: Motion, rig: Rig) -> dict[Part, Float[np.ndarray, "T n"]]:
    """Where the parts of a body point: unit vectors, and of hands their turn since the T-pose."""
    positions, world = forward(motion)
    turns = quat_mul(world, quat_conj(rig.tpose))
    bones = bone_directions(rig, positions, turns)
    found = {_part(role, "limb"): direction for role, direction in bones.items()}
    if has_shoulders(rig):
        along = hips_to_shoulders(rig, positions)
        length = np.linalg.norm(along, axis=1, keepdims=True)
        found[Part("trunk", "trunk")] = along / np.maximum(length, 1e-12)
    for role in (*_LOOKING, *HANDS):
        if (joint := rig.roles.joint(role)) is not None:
            turn = turns[:, rig.palms.get(joint, joint)]
            found[_part(role, role.part)] = turn if role in HANDS else quat_rotate(turn, _AHEAD)
    return found


def _part(role: Role, kind: str) -> Part:
    return Part(role.replace("_", " "), kind)


def _between(
    one: Float[np.ndarray, "T n"], other: Float[np.ndarray, "T n"]
) -> Float[np.ndarray, "T"]:
    cosine = np.clip((one * other).sum(axis=1), -1.0, 1.0)
    # Both signs of a quaternion are the same turn, and it holds half of the angle.
    return 2 * np.arccos(np.abs(cosine)) if one.shape[1] == 4 else np.arccos(cosine)
