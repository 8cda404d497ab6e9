"""Recordings: a file, the motion that it holds in SI units and Z-up axes, and the way back.

This is the border where file units, file axes, Euler angles and degrees end.
"""

from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float

from spark.bvh import Bvh, BvhJoint, Vector, read_bvh
from spark.convention import Convention, given_unit, given_up, infer_unit, infer_up
from spark.errors import ConventionError, SkeletonError
from spark.euler import euler_over_time
from spark.motion import Motion
from spark.rotation import AXES, quat_about, quat_angle, quat_identity, quat_mul
from spark.skeleton import Skeleton

# Frames that unit and up axis are read off.
_SAMPLES = 32

# Positions that stay within this fraction of the body's height are constant.
_STILL = 1e-6

# Rotations that a joint's channels can't express go without a note up to this angle [rad].
_LOST_ANGLE = 1e-4


@dataclass(frozen=True, eq=False)
class Recording:
    """A file, its motion, and what was assumed between the two.

    `adds_offset` tells what the position channels of child joints mean: the position in the parent,
    as the format has it, or, as some exporters write, what to add to the OFFSET.
    """

    bvh: Bvh
    motion: Motion
    convention: Convention
    notes: tuple[str, ...] = ()
    adds_offset: bool = False


def read_recording(
    path: str | Path, *, unit: str | float | None = None, up: str | None = None
) -> Recording:
    """The recording in the BVH file at `path`.

    `unit` (a name of `spark.convention.UNITS` or metres) and `up` (x, y or z) are inferred where
    not given. A file without frames gives one frame of its rest pose. Raises `FileFormatError` as
    `read_bvh` does, and `ConventionError` where a convention isn't known or can't be inferred.
    """
    unit_m = None if unit is None else given_unit(unit)
    up_axis = None if up is None else given_up(up)
    bvh = read_bvh(path)
    motion, adds_offset, notes = _decode(bvh)
    picked = np.unique(np.linspace(0, len(motion) - 1, _SAMPLES).astype(int))
    sample = replace(
        motion,
        root_pos=motion.root_pos[picked],
        rotations=motion.rotations[picked],
        translations=None if motion.translations is None else motion.translations[picked],
    )
    found: tuple[str, ...]
    if unit_m is None:
        try:
            unit_m, found = infer_unit(sample)
        except ConventionError as error:
            raise ConventionError(f"{path}: {error}") from error
        notes += found
    if up_axis is None:
        up_axis, found = infer_up(sample)
        notes += found
    convention = Convention(unit_m, up_axis)
    return Recording(bvh, _to_si(motion, convention), convention, notes, adds_offset)


def encode(motion: Motion, template: Recording) -> tuple[Bvh, tuple[str, ...]]:
    """`motion` in the hierarchy, channels, unit and axes of `template`'s file, and notes.

    Angles run on over time without jumps of whole turns. The notes name what the file's channels
    can't express: rotations and positions of joints that lack them. Numbers are rounded to 1e-6
    degrees and 1e-8 m. Raises `SkeletonError` where `motion` has other joints than the template.
    """
    ours, theirs = motion.skeleton, template.motion.skeleton
    if ours.names != theirs.names or not np.array_equal(ours.parents, theirs.parents):
        raise SkeletonError(
            f"the motion has {len(ours)} joints, from {ours.names[0]!r} to {ours.names[-1]!r}, and "
            f"the file {len(theirs)}, from {theirs.names[0]!r} to {theirs.names[-1]!r}; expected "
            "the same joints in the same order"
        )
    bvh, convention = template.bvh, template.convention
    values = np.zeros((len(motion), bvh.values.shape[1]))
    notes = _encode_rotations(motion, bvh, convention, values)
    notes += _encode_positions(motion, template, values)
    return Bvh(bvh.joints, motion.frame_time, values + 0.0), notes  # + 0.0: no "-0.0"


def encode_new(motion: Motion, *, unit: str | float = "cm", up: str = "y") -> Bvh:
    """`motion` in a hierarchy of its own, ZXY angles, position channels where positions change.

    Joints come depth-first, as the format nests them, which may not be the skeleton's order.
    """
    convention = Convention(given_unit(unit), given_up(up))
    motion = _depth_first(motion)
    skeleton = motion.skeleton
    moving = np.arange(len(skeleton)) == 0
    if motion.translations is not None:
        moving |= skeleton.translating
    ends: defaultdict[int, list[Vector]] = defaultdict(list)
    for parent, end in zip(
        skeleton.end_parents.tolist(), _file_lengths(skeleton.end_offsets, convention), strict=True
    ):
        ends[parent].append(_vector(end))
    rotations = ("Zrotation", "Xrotation", "Yrotation")
    positions = ("Xposition", "Yposition", "Zposition")
    joints = tuple(
        BvhJoint(
            name, parent, _vector(offset), (positions if moves else ()) + rotations, tuple(end)
        )
        for name, parent, offset, moves, end in zip(
            map(_writable, skeleton.names),
            skeleton.parents.tolist(),
            _file_lengths(skeleton.offsets, convention),
            moving,
            (ends[j] for j in range(len(skeleton))),
            strict=True,
        )
    )
    empty = np.zeros((0, sum(len(joint.channels) for joint in joints)))
    template = Recording(Bvh(joints, motion.frame_time, empty), motion, convention)
    return encode(motion, template)[0]


def _decode(bvh: Bvh) -> tuple[Motion, bool, tuple[str, ...]]:
    """The motion in file units and axes, whether positions add to the offsets, and notes."""
    notes: list[str] = []
    joints, values = bvh.joints, bvh.values
    offsets = np.array([joint.offset for joint in joints])
    placed, axes, columns = _position_channels(bvh)
    if not len(values):
        notes.append("no frames in the file: its rest pose stands in as the only one")
        values = np.zeros((1, values.shape[1]))
        values[0, columns] = offsets[placed, axes]

    adds_offset = _adds_offset(np.median(values[:, columns], axis=0), offsets[placed, axes], placed)
    local = np.repeat(offsets[None], len(values), axis=0)
    if adds_offset:
        notes.append("position channels of child joints are small: read as additions to the OFFSET")
        values = values.copy()
        values[:, columns] += np.where(placed > 0, offsets[placed, axes], 0.0)
    local[:, placed, axes] = values[:, columns]

    translating = np.zeros(len(joints), dtype=bool)
    translating[placed] = translating[0] = True
    middle = np.median(local, axis=0)
    middle[0] = offsets[0]
    still = _STILL * np.linalg.norm(middle, axis=-1).max()
    moves = bool(np.any(np.ptp(local[:, 1:], axis=0) > still))
    if moves:
        count = int(np.sum(np.ptp(local[:, 1:], axis=0).max(axis=-1) > still))
        notes.append(f"{count} child joints move against their parents")

    rotations = np.repeat(quat_identity(offsets)[None], len(values), axis=0)
    for order, (members, angle_columns) in _rotation_channels(bvh).items():
        angles = np.radians(values[:, angle_columns])
        q = quat_about(order[0], angles[..., 0])  # type: ignore[arg-type]
        for i in range(1, len(order)):
            q = quat_mul(q, quat_about(order[i], angles[..., i]))  # type: ignore[arg-type]
        rotations[:, members] = q

    names = _unique_names([joint.name for joint in joints])
    renamed = [name for name, joint in zip(names, joints, strict=True) if name != joint.name]
    if renamed:
        notes.append(f"repeated joint names got numbers: {_list(renamed)}")
    end_parents = [j for j, joint in enumerate(joints) for _ in joint.ends]
    end_offsets = [end for joint in joints for end in joint.ends]
    skeleton = Skeleton(
        names,
        np.array([joint.parent for joint in joints]),
        middle,
        translating,
        np.array(end_parents, dtype=np.int64),
        np.array(end_offsets, dtype=np.float64).reshape(-1, 3),
    )
    motion = Motion(skeleton, bvh.frame_time, local[:, 0], rotations, local if moves else None)
    return motion, adds_offset, tuple(notes)


def _position_channels(bvh: Bvh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Joint, file axis and column of every position channel."""
    found = [
        (j, "XYZ".index(channel[0]), columns.start + i)
        for j, (joint, columns) in enumerate(zip(bvh.joints, bvh.columns, strict=True))
        for i, channel in enumerate(joint.channels)
        if channel.endswith("position")
    ]
    table = np.array(found, dtype=np.int64).reshape(-1, 3)
    return table[:, 0], table[:, 1], table[:, 2]


def _rotation_channels(bvh: Bvh) -> dict[str, tuple[list[int], list[list[int]]]]:
    """By order of the file's rotation axes ("zxy"): the joints that have it, and their columns."""
    groups: dict[str, tuple[list[int], list[list[int]]]] = {}
    for j, (joint, columns) in enumerate(zip(bvh.joints, bvh.columns, strict=True)):
        found = [i for i, channel in enumerate(joint.channels) if channel.endswith("rotation")]
        if found:
            order = "".join(joint.channels[i][0].lower() for i in found)
            members, where = groups.setdefault(order, ([], []))
            members.append(j)
            where.append([columns.start + i for i in found])
    return groups


def _adds_offset(
    middle: Float[np.ndarray, "P"], offsets: Float[np.ndarray, "P"], placed: np.ndarray
) -> bool:
    """Whether more children have position channels near zero than near their OFFSET."""
    near_zero = near_offset = 0
    for joint in np.unique(placed[placed > 0]):
        mine = placed == joint
        length = np.linalg.norm(offsets[mine])
        near_zero += bool(np.linalg.norm(middle[mine]) < 0.1 * length)
        near_offset += bool(np.linalg.norm(middle[mine] - offsets[mine]) < 0.1 * length)
    return near_zero > near_offset


def _to_si(motion: Motion, convention: Convention) -> Motion:
    axes, unit = list(convention.axes), convention.unit_m
    skeleton = motion.skeleton
    translations = motion.translations
    return replace(
        motion,
        skeleton=replace(
            skeleton,
            offsets=skeleton.offsets[:, axes] * unit,
            end_offsets=skeleton.end_offsets[:, axes] * unit,
        ),
        root_pos=motion.root_pos[:, axes] * unit,
        rotations=motion.rotations[..., [0, *(1 + axis for axis in axes)]],
        translations=None if translations is None else translations[..., axes] * unit,
    )


def _encode_rotations(
    motion: Motion, bvh: Bvh, convention: Convention, values: Float[np.ndarray, "T C"]
) -> tuple[str, ...]:
    """Fill the rotation channels; notes on rotations that the channels don't reach."""
    internal_of = {AXES[axis]: AXES[i] for i, axis in enumerate(convention.axes)}
    lost = quat_angle(quat_identity(motion.rotations), motion.rotations)
    for order, (members, columns) in _rotation_channels(bvh).items():
        internal = "".join(internal_of[axis] for axis in order)  # type: ignore[index]
        q = motion.rotations[:, members]
        angles = euler_over_time(q, internal)
        values[:, columns] = np.round(np.degrees(angles), 6)
        back = quat_about(internal[0], angles[..., 0])  # type: ignore[arg-type]
        for i in range(1, len(internal)):
            back = quat_mul(back, quat_about(internal[i], angles[..., i]))  # type: ignore[arg-type]
        lost[:, members] = quat_angle(back, q)
    worst = lost.max(axis=0)
    names = [bvh.joints[j].name for j in np.flatnonzero(worst > _LOST_ANGLE)]
    if not names:
        return ()
    return (
        f"no rotation channels for all that {_list(names)} turn: up to "
        f"{np.degrees(worst.max()):.3g} degrees are lost",
    )


def _encode_positions(
    motion: Motion, template: Recording, values: Float[np.ndarray, "T C"]
) -> tuple[str, ...]:
    """Fill the position channels; notes on positions that the channels don't reach."""
    bvh, convention = template.bvh, template.convention
    placed, axes, columns = _position_channels(bvh)
    local = np.repeat(motion.skeleton.offsets[None], len(motion), axis=0)
    if motion.translations is not None:
        local[:] = motion.translations
    local[:, 0] = motion.root_pos
    in_file = np.empty_like(local)
    in_file[..., list(convention.axes)] = local / convention.unit_m
    offsets = np.array([joint.offset for joint in bvh.joints])
    start = np.where((placed > 0) & template.adds_offset, offsets[placed, axes], 0.0)
    values[:, columns] = np.round(in_file[:, placed, axes] - start, _decimals(convention))

    lost = np.abs(in_file - offsets)
    lost[:, placed, axes] = 0.0
    worst = lost.max(axis=(0, 2)) * convention.unit_m
    size = np.linalg.norm(motion.skeleton.offsets, axis=-1).max()
    names = [bvh.joints[j].name for j in np.flatnonzero(worst > 10 * _STILL * size)]
    if not names:
        return ()
    return (
        f"no position channels for where {_list(names)} lie in their parents: up to "
        f"{worst.max():.3g} m are lost",
    )


def _decimals(convention: Convention) -> int:
    return round(8 + float(np.log10(convention.unit_m)))


def _file_lengths(vectors: Float[np.ndarray, "n 3"], convention: Convention) -> np.ndarray:
    in_file = np.empty_like(vectors)
    in_file[:, list(convention.axes)] = vectors / convention.unit_m
    return np.round(in_file, _decimals(convention)) + 0.0


def _vector(row: Float[np.ndarray, "3"]) -> Vector:
    x, y, z = row.tolist()
    return x, y, z


def _writable(name: str) -> str:
    """The name without what ends a name in a BVH file."""
    return "".join("_" if letter in "\r\n{}" else letter for letter in name).strip() or "_"


def _depth_first(motion: Motion) -> Motion:
    """The same motion with its joints in the order in which a file nests them."""
    skeleton = motion.skeleton
    order: list[int] = []
    stack = [0]
    while stack:
        order.append(stack.pop())
        stack += reversed(skeleton.children[order[-1]])
    place = np.argsort(order)
    parents = skeleton.parents[order]
    return replace(
        motion,
        skeleton=Skeleton(
            tuple(skeleton.names[j] for j in order),
            np.where(parents < 0, -1, place[parents]),
            skeleton.offsets[order],
            skeleton.translating[order],
            place[skeleton.end_parents],
            skeleton.end_offsets,
        ),
        rotations=motion.rotations[:, order],
        translations=None if motion.translations is None else motion.translations[:, order],
    )


def _unique_names(names: list[str]) -> tuple[str, ...]:
    """Repeated names with a number: Toe, Toe.2, Toe.3."""
    taken, unique = set(names), list[str]()
    seen: set[str] = set()
    for name in names:
        number, candidate = 1, name
        while candidate in seen or (number > 1 and candidate in taken):
            number += 1
            candidate = f"{name}.{number}"
        seen.add(candidate)
        unique.append(candidate)
    return tuple(unique)


def _list(names: list[str]) -> str:
    shown = ", ".join(map(repr, names[:5]))
    return shown + (f" and {len(names) - 5} more" if len(names) > 5 else "")
