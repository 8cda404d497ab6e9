"""Arrays in npy and npz files: the plain ones alone, and never more memory than the file has bytes.

A file of numpy's may hold pickles beside numbers (object arrays). A pickle is a program, so it is
never run: such members are left out, and named.
"""

import re
import struct
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np

from spark.errors import FileFormatError, name_list
from spark.npz import Npz, array_in, holds_objects
from spark.opening import beginning, check_regular, read_bytes

_MAGIC = b"\x93NUMPY"
# That of the file first: who resamples a recording and keeps its other arrays leaves `mocap_...`.
_RATES = (
    *("fps", "frame_rate", "framerate"),
    *("mocap_frame_rate", "mocap_framerate", "mocap_fps"),
)
_MAX_HEADER = 65536  # bytes; numpy's own writer stays below for plain dtypes


class Arrays(dict[str, np.ndarray]):
    """The plain arrays of an npz by name; `pickled` are the members that were left out.

    One number or text that was saved as a Python object is plain too: AMASS has such."""

    pickled: tuple[str, ...] = ()


def read_npz(path: Path) -> Arrays:
    """All plain arrays of an npz. Raises `FileFormatError` where it is none, or is cut short."""
    stored = Npz(path, expected="a motion")
    pickled = stored.pickled
    arrays = Arrays({name: stored[name] for name in stored if name not in pickled})
    lone = {name: stored.lone_value(name) for name in pickled}
    arrays |= {name: value for name, value in lone.items() if value is not None}
    arrays.pickled = tuple(name for name in pickled if lone[name] is None)
    return arrays


def npz_names(path: Path) -> frozenset[str]:
    """The names of the arrays of an npz; none where it is no such file."""
    try:
        check_regular(path)
        with zipfile.ZipFile(path) as stored:
            return frozenset(name.removesuffix(".npy") for name in stored.namelist())
    except (
        *(FileFormatError, OSError, ValueError, struct.error),
        *(zipfile.BadZipFile, NotImplementedError, IndexError),
    ):
        return frozenset()


def npy_shape(path: Path) -> tuple[int, ...]:
    """The shape that an npy claims to have; () where it is no such file."""
    header = beginning(path, _MAX_HEADER).decode("latin-1")
    found = re.search(r"'shape': \((\d{1,15}(?:, ?\d{1,15})*),?\)", header)
    plain = header.startswith(_MAGIC.decode("latin-1")) and found is not None
    return tuple(map(int, found[1].split(","))) if plain and found else ()


def read_npy(path: Path) -> np.ndarray:
    """The one array of an npy. Raises `FileFormatError` where it is none, or holds a pickle."""
    data = read_bytes(path, expected="a motion")
    if holds_objects(data):
        raise FileFormatError(
            path,
            None,
            "holds Python objects (a pickle, which can run any program), not plain numbers; save "
            "the array that is meant with numpy.save(..., allow_pickle=False)",
        )
    try:
        return array_in(data)
    except ValueError as error:
        raise FileFormatError(path, None, f"is no array of numpy's: {error}") from error


def numbers(
    arrays: Mapping[str, np.ndarray], name: str, path: Path, *, finite: bool = True
) -> np.ndarray:
    """The array `name` as float64. Raises `FileFormatError` where it holds no (finite) numbers."""
    array = arrays[name]
    if array.dtype.kind not in "fiub":
        raise FileFormatError(path, None, f"{name!r} holds {array.dtype} and no real numbers")
    array = array.astype(np.float64)
    if finite and not np.isfinite(array).all():
        at = np.argwhere(~np.isfinite(array))[0].tolist()
        raise FileFormatError(path, None, f"{name!r} holds {array[tuple(at)]} at {at}")
    return array


def held(arrays: Arrays) -> str:
    """What the file holds, for messages."""
    names = [f"{name} {'x'.join(map(str, array.shape))}" for name, array in arrays.items()]
    pickled = f", and Python objects ({name_list(list(arrays.pickled))})" if arrays.pickled else ""
    return (", ".join(names[:12]) or "nothing") + pickled


def first_of(arrays: Mapping[str, np.ndarray], names: Iterable[str]) -> str | None:
    """The first of the names that one thing has in files of different tools; None without."""
    return next((name for name in names if name in arrays), None)


def rate_in(arrays: Mapping[str, np.ndarray], path: Path, notes: list[str]) -> float | None:
    """Frames a second, as one of the arrays says; `notes` says where another says otherwise.
    Raises `FileFormatError` where it can't be."""
    names = [name for name in _RATES if name in arrays and arrays[name].size == 1]
    said = {name: float(numbers(arrays, name, path).ravel()[0]) for name in names}
    for name, fps in said.items():
        if not 1 <= fps <= 10000:
            raise FileFormatError(path, None, f"{name!r} is {fps:g}; expected frames a second")
    if len({*said.values()}) > 1:
        rates = ", ".join(f"{name!r} is {fps:g}" for name, fps in said.items())
        notes.append(
            f"two rates: {rates}; the first counts, unless --fps (of retarget: --source-fps) gives "
            "another"
        )
    return next(iter(said.values()), None)
