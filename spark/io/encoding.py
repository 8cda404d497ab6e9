"""Motions back into files: the way from SI units and Z-up axes to the numbers of a BVH."""

import re
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from spark.blocks import blocks
from spark.errors import SkeletonError, name_list
from spark.io.bvh import Bvh
from spark.io.bvh_hierarchy import BvhJoint, Vector
from spark.io.convention import Convention, given_unit, given_up
from spark.io.euler import angles_of, angles_over_time, quat_from_angles
from spark.io.recording import Recording
from spark.motion import Motion
from spark.rotation import quat_angle, quat_identity
from spark.skeleton import Skeleton

# What channels can't express is said in a note beyond these: 0.006 degrees, and 0.05 mm of a thigh.
_MAX_LOST_ANGLE = 1e-4  # [rad]
_MAX_LOST_LENGTH = 1e-4  # of the longest bone

_POSITIONS = ("Xposition", "Yposition", "Zposition")
_ROTATIONS = ("Zrotation", "Xrotation", "Yrotation")


def encode(motion: Motion, template: Recording) -> tuple[Bvh, tuple[str, ...]]:
    """`motion` in the hierarchy, channels, unit and axes of `template`'s file, and notes.

    Angles run on over time without jumps of whole turns. The notes name what the file's channels
    can't express: rotations and positions of joints that lack them. Numbers are rounded to 1e-6
    degrees and 1e-8 m. Raises `SkeletonError` where `motion` has other joints than the template.
    """
    own, expected = motion.skeleton, template.motion.skeleton
    if own.names != expected.names or not np.array_equal(own.parents, expected.parents):
        raise SkeletonError(
            f"the motion has {len(own)} joints, from {own.names[0]!r} to {own.names[-1]!r}, and "
            f"the file {len(expected)}, from {expected.names[0]!r} to "
            f"{expected.names[-1]!r}; expected "
            "the same joints in the same order"
        )
    bvh, convention = template.bvh, template.convention
    values = np.zeros((len(motion), bvh.values.shape[1]))
    notes = _encode_rotations(motion, bvh, convention, values)
    notes += _encode_positions(motion, template, values)
    return Bvh(bvh.joints, motion.frame_time, values, encoding=bvh.encoding), notes


def encode_new(motion: Motion, *, unit: str | float = "cm", up: str = "y") -> Bvh:
    """`motion` in a hierarchy of its own, ZXY angles, position channels where positions change.

    Joints come depth-first, as the format nests them, which may not be the skeleton's order. The
    root's OFFSET is zero, since some readers add it to its position.
    """
    convention = Convention(given_unit(unit), given_up(up))
    motion = _depth_first(motion)
    skeleton = motion.skeleton
    moves = np.arange(len(skeleton)) == 0
    if motion.translations is not None:
        moves |= np.any(motion.translations != skeleton.offsets, axis=(0, 2))
    offsets = convention.to_file(skeleton.offsets)
    offsets[0] = 0.0
    ends = convention.to_file(skeleton.end_offsets)
    joints = tuple(
        BvhJoint(
            _writable(name),
            int(skeleton.parents[j]),
            _vector(offsets[j]),
            (_POSITIONS if moves[j] else ()) + _ROTATIONS,
            tuple(map(_vector, ends[skeleton.end_parents == j])),
        )
        for j, name in enumerate(skeleton.names)
    )
    empty = np.zeros((0, sum(len(joint.channels) for joint in joints)))
    template = Recording(Bvh(joints, motion.frame_time, empty), motion, convention)
    return encode(motion, template)[0]


def _encode_rotations(
    motion: Motion, bvh: Bvh, convention: Convention, values: Float[np.ndarray, "T C"]
) -> tuple[str, ...]:
    """Fill the rotation channels; notes on rotations that the channels don't reach."""
    worst = np.zeros(len(bvh.joints))
    for block in blocks(len(motion)):
        rotations = motion.picked(block).rotations
        in_file = convention.turns_to_file(rotations)
        lost = quat_angle(quat_identity(in_file), in_file)
        for order, (members, columns) in bvh.rotation_channels.items():
            angles = angles_of(in_file[:, members], order)
            values[block, columns] = angles
            lost[:, members] = quat_angle(quat_from_angles(angles, order), in_file[:, members])
        worst = np.maximum(worst, lost.max(axis=0))
    for order, (_, columns) in bvh.rotation_channels.items():
        for joint in columns:  # one at a time: what is in between is several times as large
            angles = angles_over_time(values[:, joint], order)
            values[:, joint] = np.round(np.degrees(angles), 6) + 0.0  # no "-0.0"
    names = [bvh.joints[j].name for j in np.flatnonzero(worst > _MAX_LOST_ANGLE)]
    if not names:
        return ()
    return (
        f"no rotation channels for all that {name_list(names)} turn: up to "
        f"{np.degrees(worst.max()):.3g} degrees are lost",
    )


def _encode_positions(
    motion: Motion, template: Recording, values: Float[np.ndarray, "T C"]
) -> tuple[str, ...]:
    """Fill the position channels; notes on positions that the channels don't reach."""
    bvh, convention = template.bvh, template.convention
    joints, axes, columns = bvh.position_channels.T
    offsets = np.array([joint.offset for joint in bvh.joints])
    worst = np.zeros(len(bvh.joints))
    for block in blocks(len(motion)):
        in_file = convention.to_file(motion.picked(block).local_positions)
        values[block, columns] = in_file[:, joints, axes]
        lost = np.abs(in_file - offsets) * convention.unit_m
        lost[:, joints, axes] = 0.0
        worst = np.maximum(worst, lost.max(axis=(0, 2)))
    if template.adds_offset:
        values[:, columns] -= np.where(joints > 0, offsets[joints, axes], 0.0)
    longest = np.linalg.norm(motion.skeleton.offsets, axis=-1).max()
    names = [bvh.joints[j].name for j in np.flatnonzero(worst > _MAX_LOST_LENGTH * longest)]
    if not names:
        return ()
    return (
        f"no position channels for where {name_list(names)} lie in their parents: up to "
        f"{worst.max():.3g} m are lost",
    )


def _vector(row: Float[np.ndarray, "3"]) -> Vector:
    x, y, z = row.tolist()
    return x, y, z


def _writable(name: str) -> str:
    """The name without what a BVH file can't hold in one."""
    return re.sub(r"[\r\n{}]", "_", name).strip() or "_"


def _depth_first(motion: Motion) -> Motion:
    """The same motion with its joints in the order in which a file nests them."""
    skeleton = motion.skeleton
    order: list[int] = []
    stack = [0]
    while stack:
        order.append(stack.pop())
        stack += reversed(skeleton.children[order[-1]])
    new_index = np.argsort(order)
    parents = skeleton.parents[order]
    return replace(
        motion,
        skeleton=Skeleton(
            tuple(skeleton.names[j] for j in order),
            np.where(parents < 0, -1, new_index[parents]),
            skeleton.offsets[order],
            skeleton.translating[order],
            new_index[skeleton.end_parents],
            skeleton.end_offsets,
        ),
        rotations=motion.rotations[:, order],
        translations=None if motion.translations is None else motion.translations[:, order],
    )
