"""Recordings: a file, and the motion that it holds in SI units and Z-up axes.

This is the border where file units, file axes, Euler angles and degrees end; `spark.io.encoding` is
the way back.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Float, Int

from spark.blocks import BLOCK, blocks
from spark.errors import ConventionError, FileFormatError
from spark.io.bvh import Bvh, read_bvh
from spark.io.convention import Convention, given_unit, given_up
from spark.io.euler import quat_from_angles
from spark.io.given import doubts
from spark.io.joint_names import unique_names
from spark.io.unit_inference import infer_unit
from spark.io.up_inference import infer_up
from spark.motion import LazyMotion, Motion, check_frame_time
from spark.rotation import quat_identity
from spark.skeleton import Skeleton

_SAMPLES = 32  # frames that unit and up axis are inferred from
_USUAL_FRAME_TIME = (0.001, 0.5)  # [s] 1000 to 2 frames a second

_ENCODINGS = {"cp932": "Shift-JIS", "latin-1": "Latin-1"}

# Of the body's height: positions that vary less are constant.
_CONSTANT = 1e-6
_STILL_ANGLE = 0.3  # in the file's unit: what moves less has no angles to tell the unit by


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

    `unit` (a name of `spark.io.convention.UNITS` or metres) and `up` (one of its `UPS`) are
    inferred where not given; `fps` replaces the Frame Time. A file without frames gives one frame
    of its rest pose. Raises `FileFormatError` as `read_bvh` does, and `ConventionError` where a
    convention isn't known or can't be inferred.
    """
    unit_m = None if unit is None else given_unit(unit)
    up_axis = None if up is None else given_up(up)
    bvh = read_bvh(path, frame_time=None if fps is None else 1 / fps)
    try:
        check_frame_time(bvh.frame_time, "Frame Time")
    except ConventionError as error:
        raise FileFormatError(path, None, f"{error}; or give --fps") from error
    decoder = _Decoder(bvh)
    notes = decoder.notes
    sample = decoder.motion(np.unique(np.linspace(0, len(decoder) - 1, _SAMPLES).astype(int)))
    notes += doubts(sample, unit_m=unit_m, up=up_axis)
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
    motion = decoder.in_si(convention)
    return Recording(bvh, motion, convention, notes, decoder.adds_offset)


class _Decoder:
    """What the rows of a file mean. Of a long file, frames are decoded as they are asked for.

    `adds_offset` is whether positions add to the offsets; `notes` tell what was assumed.
    """

    def __init__(self, bvh: Bvh) -> None:
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

        notes += _in_radians(np.delete(values, columns, axis=1))
        child = placed > 0
        middle = np.array([np.median(values[:, column]) for column in columns])
        spread = np.array([np.ptp(values[:, column]) for column in columns])
        self.adds_offset = _adds_offset(middle, offsets[placed, axes], placed)
        self._start = np.where(child & self.adds_offset, offsets[placed, axes], 0.0)
        if self.adds_offset:
            notes.append(
                "position channels of child joints are small: read as additions to the OFFSET"
            )
        rest = offsets.copy()
        rest[placed[child], axes[child]] = (middle + self._start)[child]
        still = _CONSTANT * np.linalg.norm(rest[1:], axis=-1).max(initial=0.0)
        self._stretches = bool(np.any(spread[child] > still))

        names, renamed = unique_names([joint.name for joint in joints])
        ends = [(j, end) for j, joint in enumerate(joints) for end in joint.ends]
        self._skeleton = Skeleton(
            names,
            np.array([joint.parent for joint in joints]),
            rest,
            np.isin(np.arange(len(joints)), [0, *placed]),
            np.array([j for j, _ in ends], dtype=np.int64),
            np.array([end for _, end in ends], dtype=np.float64).reshape(-1, 3),
        )
        self._bvh, self._values, self._offsets = bvh, values, offsets
        self.notes = (*notes, *renamed)

    def __len__(self) -> int:
        return len(self._values)

    def motion(self, picked: Int[np.ndarray, "N"] | slice) -> Motion:
        """These frames in file units and axes."""
        bvh, values, offsets = self._bvh, self._values[picked], self._offsets
        placed, axes, columns = bvh.position_channels.T
        positions = values[:, columns] + self._start
        root = placed == 0
        root_pos = np.repeat(offsets[:1], len(values), axis=0)
        root_pos[:, axes[root]] = positions[:, root]
        translations = None
        if self._stretches:
            translations = np.repeat(offsets[None], len(values), axis=0)
            translations[:, placed, axes] = positions
        rotations = np.empty((len(values), len(offsets), 4))
        rotations[:] = quat_identity(offsets)
        for order, (members, angle_columns) in bvh.rotation_channels.items():
            for block in blocks(len(values)):
                angles = np.radians(values[block][:, angle_columns])
                rotations[block, members] = quat_from_angles(angles, order)
        return Motion(self._skeleton, bvh.frame_time, root_pos, rotations, translations)

    def in_si(self, convention: Convention) -> Motion:
        """All frames in metres and internal axes, as far as they will be asked for."""

        def make(span: slice) -> Motion:
            return in_si(self.motion(span), convention)

        if len(self) <= BLOCK:
            return make(slice(None))
        placed, axes, columns = self._bvh.position_channels.T
        root = placed == 0
        root_pos = np.repeat(self._offsets[:1], len(self), axis=0)
        root_pos[:, axes[root]] = self._values[:, columns[root]]
        first = make(slice(0, 1))
        return LazyMotion(first.skeleton, first.frame_time, convention.from_file(root_pos), make)


def _in_radians(angles: Float[np.ndarray, "T C"]) -> list[str]:
    """A note where a body that moves has no angle beyond a full turn in radians."""
    largest = float(np.abs(angles).max(initial=0.0))
    if largest > 2 * np.pi or not np.any(np.ptp(angles, axis=0) > _STILL_ANGLE):
        return []
    return [
        f"no angle is larger than {largest:.3g}: a BVH holds degrees; if these are radians, "
        "multiply them by 57.2958"
    ]


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
        rotations=_turned(motion.rotations, convention),
        translations=None if translations is None else convention.from_file(translations),
    )


def _turned(
    rotations: Float[np.ndarray, "T J 4"], convention: Convention
) -> Float[np.ndarray, "T J 4"]:
    out = np.empty_like(rotations)
    for block in blocks(len(rotations)):
        out[block] = convention.turns_from_file(rotations[block])
    return out
