"""Files of named arrays: npz, read without pickle, and checked."""

import io
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from spark.errors import FileFormatError

_MAGIC = (b"PK", b"\x93NUMPY")  # others numpy takes for pickles


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """All arrays of an npz. Raises `FileFormatError` where it is none, or needs pickle."""
    try:
        content = path.read_bytes()
        if content and not content.startswith(_MAGIC):
            raise FileFormatError(path, None, "is no npz; expected the motion of a robot")
        with np.load(io.BytesIO(content), allow_pickle=False) as stored:
            if not hasattr(stored, "files"):
                raise FileFormatError(path, None, "is a single array; expected an npz of several")
            return {name: stored[name] for name in stored.files}
    except OSError as error:
        raise FileFormatError(path, None, f"can't be read ({error.strerror or error})") from error
    except (ValueError, EOFError, KeyError, zipfile.BadZipFile, zlib.error, MemoryError) as error:
        what = "is empty" if not path.stat().st_size else f"is no npz ({_first(error)})"
        raise FileFormatError(path, None, f"{what}; expected the motion of a robot") from error


def number_array(
    arrays: Mapping[str, object], name: str, path: Path, shape: tuple[int | None, ...]
) -> np.ndarray:
    """The array `name` as float64. Raises `FileFormatError` where it is missing, holds no numbers,
    or has another shape; None is any length."""
    if name not in arrays:
        raise FileFormatError(
            path, None, f"has no {name!r}; it holds {', '.join(map(repr, arrays)) or 'nothing'}"
        )
    try:
        array = np.asarray(arrays[name], dtype=np.float64)
    except (ValueError, TypeError) as error:
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
    if name in arrays and np.size(np.asarray(arrays[name], dtype=object)) == 1:
        arrays = {name: np.asarray(arrays[name]).reshape(())}
    return float(number_array(arrays, name, path, ()))


def _first(error: BaseException) -> str:
    return str(error).splitlines()[0] if str(error) else type(error).__name__
