"""Recordings: a file, and the motion that it holds in SI units and Z-up axes.

This is the border where file units, file axes, Euler angles and degrees end; `spark.io.encoding` is
the way back.
"""

from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from spark.errors import ConventionError, FileFormatError, name_list
from spark.io.bvh import Bvh, read_bvh
from spark.io.convention import Convention, given_unit, given_up, infer_unit, infer_up
from spark.io.euler import quat_from_angles
from spark.motion import Motion, check_frame_time
from spark.rotation import quat_identity
from spark.skeleton import Skeleton

_SAMPLES = 32  # frames that unit and up axis are inferred from
_USUAL_FRAME_TIME = (0.001, 0.5)  # [s] 1000 to 2 frames a second

_ENCODINGS = {"cp932": "Shift-JIS", "latin-1": "Latin-1"}

# Of the body's height: positions that vary less are constant.
_CONSTANT = 1e-6


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

    def __repr__(self) -> str:
        return f"Recording({self.bvh!r}, unit {self.convention.unit}, {self.convention.up} up)"


def read_recording(
    path: str | Path,
    *,
    unit: str | float | None = None,
    up: str | None = None,
    fps: float | None = None,
) -> Recording:
    """The recording in the BVH file at `path`.

    `unit` (a name of `spark.io.convention.UNITS` or metres) and `up` (x, y or z) are inferred where
    not given; `fps` replaces the Frame Time. A file without frames gives one frame of its rest
    pose. Raises `FileFormatError` as `read_bvh` does, and `ConventionError` where a convention
    isn't known or can't be inferred.
    """
    unit_m = None if unit is None else given_unit(unit)
    up_axis = None if up is None else given_up(up)
    bvh = read_bvh(path)
    if fps is not None:
        bvh = replace(bvh, frame_time=1 / fps)
    try:
        check_frame_time(bvh.frame_time, "Frame Time")
    except ConventionError as error:
        raise FileFormatError(path, None, f"{error}; or give --fps") from error
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
    return Recording(bvh, in_si(motion, convention), convention, notes, adds_offset)


def _decode(bvh: Bvh) -> tuple[Motion, bool, tuple[str, ...]]:
    """The motion in file units and axes, whether positions add to the offsets, and notes."""
    notes = list(bvh.repairs)
    if bvh.encoding != "utf-8":
        notes.append(f"joint names are not UTF-8: read as {_ENCODINGS[bvh.encoding]}")
    if not _USUAL_FRAME_TIME[0] <= bvh.frame_time <= _USUAL_FRAME_TIME[1]:
        notes.append(
            f"a frame lasts {bvh.frame_time:g} s, which is unusual; Frame Time is in seconds"
        )
    joints, values = bvh.joints, bvh.values
    offsets = np.array([joint.offset for joint in joints])
    placed, axes, columns = bvh.position_channels.T
    if not len(values):
        notes.append("no frames in the file: its rest pose stands in as the only one")
        values = np.zeros((1, values.shape[1]))
        values[0, columns] = offsets[placed, axes]

    positions = values[:, columns]
    child = placed > 0
    middle = np.median(positions, axis=0)
    adds_offset = _adds_offset(middle, offsets[placed, axes], placed)
    if adds_offset:
        notes.append("position channels of child joints are small: read as additions to the OFFSET")
        start = np.where(child, offsets[placed, axes], 0.0)
        positions, middle = positions + start, middle + start
    root_pos = np.repeat(offsets[:1], len(values), axis=0)
    root_pos[:, axes[~child]] = positions[:, ~child]
    rest = offsets.copy()
    rest[placed[child], axes[child]] = middle[child]
    still = _CONSTANT * np.linalg.norm(rest[1:], axis=-1).max(initial=0.0)
    translations = None
    if np.any(np.ptp(positions[:, child], axis=0) > still):
        translations = np.repeat(offsets[None], len(values), axis=0)
        translations[:, placed, axes] = positions

    rotations = np.repeat(quat_identity(offsets)[None], len(values), axis=0)
    for order, (members, angle_columns) in bvh.rotation_channels.items():
        rotations[:, members] = quat_from_angles(np.radians(values[:, angle_columns]), order)

    names, renamed = unique_names([joint.name for joint in joints])
    notes += renamed
    ends = [(j, end) for j, joint in enumerate(joints) for end in joint.ends]
    skeleton = Skeleton(
        names,
        np.array([joint.parent for joint in joints]),
        rest,
        np.isin(np.arange(len(joints)), [0, *placed]),
        np.array([j for j, _ in ends], dtype=np.int64),
        np.array([end for _, end in ends], dtype=np.float64).reshape(-1, 3),
    )
    motion = Motion(skeleton, bvh.frame_time, root_pos, rotations, translations)
    return motion, adds_offset, tuple(notes)


def _adds_offset(
    middle: Float[np.ndarray, "P"], offsets: Float[np.ndarray, "P"], joints: Int[np.ndarray, "P"]
) -> bool:
    """Whether more children have position channels near zero than near their OFFSET."""

    def lengths(vectors: Float[np.ndarray, "P"]) -> Float[np.ndarray, "J"]:
        return np.sqrt(np.bincount(joints, vectors**2, minlength=1))[1:]

    near = 0.1 * lengths(offsets)
    return bool(np.sum(lengths(middle) < near) > np.sum(lengths(middle - offsets) < near))


def in_si(motion: Motion, convention: Convention) -> Motion:
    """A motion in file units and axes, in metres and internal axes."""
    skeleton, translations = motion.skeleton, motion.translations
    return replace(
        motion,
        skeleton=replace(
            skeleton,
            offsets=convention.from_file(skeleton.offsets),
            end_offsets=convention.from_file(skeleton.end_offsets),
        ),
        root_pos=convention.from_file(motion.root_pos),
        rotations=motion.rotations[..., [0, *(1 + axis for axis in convention.axes)]],
        translations=None if translations is None else convention.from_file(translations),
    )


def unique_names(names: list[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Repeated names with a number (Toe, Toe.2, Toe.3), and a note on them."""
    taken = set(names)
    repeats = Counter[str]()
    unique: list[str] = []
    for name in names:
        repeats[name] += 1
        candidate = name
        while repeats[name] > 1 and candidate in taken:
            candidate = f"{name}.{repeats[name]}"
            repeats[name] += candidate in taken
        taken.add(candidate)
        unique.append(candidate)
    renamed = [name for name, before in zip(unique, names, strict=True) if name != before]
    notes = (f"repeated joint names got numbers: {name_list(renamed)}",) if renamed else ()
    return tuple(unique), notes
