"""Numbers that are numbers: what is read and what is written holds no NaN, and nothing infinite."""

from pathlib import Path

import numpy as np
from jaxtyping import Shaped

from spark.errors import OutputError

_AT_ONCE = 1 << 22  # numbers: a memory map is not taken into memory whole

Array = Shaped[np.ndarray, "..."]


def first_not_finite(array: Array) -> tuple[int, ...] | None:
    """Where the first number that is NaN or infinite stands; None where there is none."""
    if array.dtype.kind not in "fc":
        return None
    rows = max(_AT_ONCE * len(array) // max(array.size, 1), 1) if array.ndim else 1
    for start in range(0, len(array) if array.ndim else 1, rows):
        part = array[start : start + rows] if array.ndim else array[None]
        bad = np.argwhere(~np.isfinite(part))
        if len(bad):
            first, *rest = bad[0].tolist()
            return (start + first, *rest)
    return None


def check_output(path: Path, **arrays: Array) -> None:
    """Raise `OutputError` where a result has a number that is none: nothing is written of it."""
    for name, array in arrays.items():
        at = first_not_finite(array)
        if at is not None:
            frame, *place = at
            where = f"{name} {place[0]}" if place else name
            raise OutputError(
                f"{path}: not written: {where} of frame {frame} is {array[at]}, which is no "
                "number; is a bone of the target without length, or the source far from the origin?"
            )
