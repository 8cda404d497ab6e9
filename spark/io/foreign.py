"""Recordings of files that are no BVH: their motion in SI, and the same motion as a new BVH.

Such formats are read only. What is written back, and what a result is written as, is the BVH.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from spark.errors import ConventionError, FileFormatError
from spark.io.convention import Convention, Up, axis_of, given_unit, given_up
from spark.io.encoding import encode_new
from spark.io.given import doubts
from spark.io.recording import Recording, in_si
from spark.io.scanner import LARGEST
from spark.io.unit_inference import HUMAN_HEIGHTS, infer_unit
from spark.io.up_inference import infer_up, stands_along
from spark.motion import Motion

_CREATURES = (0.05, 20.0)  # [m] sizes of creatures; of others a file's unit is not believed
_METRES_AS_CM = 100.0  # how much too small a body is whose metres went for centimetres


def foreign_recording(
    path: Path,
    motion: Motion,
    notes: Sequence[str] = (),
    *,
    unit: str | float | None,
    up: str | None,
    unit_m: float | None = None,
    up_axis: Up | None = None,
    says: str = "as the file says",
) -> Recording:
    """The recording of a motion that is in a file's units and axes.

    `unit` and `up` are what the user gives; `unit_m` and `up_axis` what the file or its format
    `says`. What neither tells is inferred. Raises `ConventionError` where it can't be, and
    `FileFormatError` where numbers are not finite, or beyond any length.
    """
    found = list(notes)
    standing: Up | None = None
    said = unit is None and unit_m is not None
    skeleton = motion.skeleton
    values = (motion.root_pos, motion.rotations, skeleton.offsets, skeleton.end_offsets)
    if not all((np.abs(value) <= LARGEST).all() for value in values):
        raise FileFormatError(path, None, f"holds numbers beyond {LARGEST:g}, or none at all")
    try:
        if unit is not None:
            unit_m = given_unit(unit)
            found += doubts(motion, unit_m=unit_m)
        elif unit_m is not None:
            unit_m, note = _believed(motion, unit_m, says)
            found.append(note)
        else:
            unit_m, more = infer_unit(motion)
            found += more
        if up is not None:
            up_axis = given_up(up)
            found += doubts(motion, up=up_axis)
        elif up_axis is not None:
            found.append(f"up axis {up_axis}, {says}")
            if (standing := stands_along(motion)) not in (up_axis, None):
                found.append(
                    f"the body stands along {standing}, in its motion and at rest: if it doesn't "
                    f"lie there, give --up={standing}"
                )
        else:
            up_axis, more = infer_up(motion)
            found += more
    except ConventionError as error:
        raise ConventionError(f"{path}: {error}") from error
    convention = Convention(unit_m, up_axis)
    tall = unit_m * float(np.ptp(skeleton.rest_positions[:, axis_of(standing or up_axis)]))
    motion = in_si(motion, convention)
    if said and not HUMAN_HEIGHTS[0] < tall < HUMAN_HEIGHTS[1]:
        found.append(f"{tall:.3g} m is no human's height; check, and give --unit")
    bvh = replace(encode_new(motion, unit=unit_m, up=up_axis), path=path)
    return Recording(bvh, motion, convention, tuple(found))


def _believed(motion: Motion, unit_m: float, says: str) -> tuple[float, str]:
    """The unit that a file says, or the one that its body's size says where no creature has the
    file's; and a note."""
    said = f"{100 * unit_m:.4g} cm, {says}"
    tall = unit_m * float(np.ptp(motion.skeleton.rest_positions, axis=0).max())
    if not _CREATURES[0] < tall < _CREATURES[1]:
        largest = unit_m * (_METRES_AS_CM if tall < _CREATURES[1] else 1.0)
        factor, _ = infer_unit(in_si(motion, Convention(largest, "z")))
        if factor * largest != unit_m:
            unit = 100 * largest * factor
            return (
                largest * factor,
                f"unit {unit:.4g} cm, by its size: in {said}, it is {tall:.4g} m",
            )
    return unit_m, f"unit {said}"
