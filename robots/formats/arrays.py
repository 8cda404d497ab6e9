"""Arrays by their names, as files hold them, and checked."""

import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from spark.errors import FileFormatError
from spark.files import write_atomically

_LARGEST = 300_000  # numbers in lists; arrays may have any number


def write_arrays(path: Path, arrays: Mapping[str, np.ndarray]) -> None:
    """Write an npz, compressed. Raises `OutputError` where `path` can't be written."""
    out = io.BytesIO()
    np.savez_compressed(out, allow_pickle=False, **arrays)
    write_atomically(path, out.getvalue())


def number_array(
    arrays: Mapping[str, object], name: str, path: Path, shape: tuple[int | None, ...]
) -> np.ndarray:
    """The array `name` as float64. Raises `FileFormatError` where it is missing, holds no numbers,
    or has another shape; None is any length."""
    if name not in arrays:
        raise FileFormatError(
            path, None, f"has no {name!r}; it holds {', '.join(map(repr, arrays)) or 'nothing'}"
        )
    value = arrays[name]
    try:
        if isinstance(value, np.ndarray | complex) and np.iscomplexobj(value):
            raise ValueError("complex numbers")
        if _count(value, depth=len(shape)) > _LARGEST:
            raise ValueError("more numbers than the file has bytes for")
        array = np.array(value, dtype=np.float64)
    except (ValueError, TypeError, OverflowError) as error:
        raise FileFormatError(path, None, f"{name!r} holds no numbers") from error
    fits = len(array.shape) == len(shape) and all(
        want is None or want == have for want, have in zip(shape, array.shape, strict=True)
    )
    if not fits:
        wanted = " x ".join("any" if want is None else str(want) for want in shape) or "one number"
        had = " x ".join(map(str, array.shape)) or "one number"
        raise FileFormatError(path, None, f"{name!r} is {had}; expected {wanted}")
    return array


def scalar(arrays: Mapping[str, object], name: str, path: Path) -> float:
    """The number `name`, which may be stored as an array of one."""
    value = arrays.get(name)
    if isinstance(value, np.ndarray) and value.size == 1:
        arrays = {name: value.reshape(())}
    return float(number_array(arrays, name, path, ()))


def _count(value: object, depth: int) -> int:
    """How many numbers a list of lists stands for, or more than `_LARGEST`: one list may stand in
    it again and again."""
    if not isinstance(value, list | tuple):
        return 1
    count = 0 if depth else _LARGEST + 1
    for item in value:
        if count > _LARGEST:
            break
        count += _count(item, depth - 1)
    return count
