"""Arrays in npy and npz files: the plain ones alone, and never more memory than the file has bytes.

A file of numpy's may hold pickles beside numbers (object arrays). A pickle is a program, so it is
never run: such members are left out, and named.
"""

import ast
import math
import re
import struct
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import NoReturn

import numpy as np

from spark.errors import FileFormatError, name_list

_MAGIC = b"\x93NUMPY"
_MAX_HEADER = 65536  # bytes; numpy's own writer stays below for plain dtypes

# Numbers are packed by a few times, constant ones by a thousand: a member beyond both is a trap.
_MAX_PACKED = 200
_ALWAYS_TAKEN = 1 << 26  # bytes


class Arrays(dict[str, np.ndarray]):
    """The plain arrays of an npz by name; `pickled` are the members that were left out."""

    pickled: tuple[str, ...] = ()


def read_npz(path: Path) -> Arrays:
    """All plain arrays of an npz. Raises `FileFormatError` where it is none, or is cut short."""
    arrays, pickled = Arrays(), []
    try:
        with zipfile.ZipFile(path) as stored:
            for member in stored.infolist():
                name = member.filename.removesuffix(".npy")
                if member.is_dir():
                    continue
                if member.file_size > max(_ALWAYS_TAKEN, _MAX_PACKED * member.compress_size):
                    raise FileFormatError(
                        path, None, f"{name!r} unpacks to {member.file_size} bytes; expected a "
                        "motion"
                    )  # fmt: skip
                array = _parse(stored.read(member), path, name)
                if array is None:
                    pickled.append(name)
                else:
                    arrays[name] = array
    except OSError as error:
        raise FileFormatError(path, None, f"can't be read ({error.strerror or error})") from error
    except (
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        NotImplementedError,  # a packing that this Python does not know
        RuntimeError,  # a password
        ValueError,
        struct.error,
    ) as error:
        raise FileFormatError(path, None, f"is no npz that can be read ({error})") from error
    arrays.pickled = tuple(pickled)
    return arrays


def npz_names(path: Path) -> frozenset[str]:
    """The names of the arrays of an npz; none where it is no such file."""
    try:
        with zipfile.ZipFile(path) as stored:
            return frozenset(name.removesuffix(".npy") for name in stored.namelist())
    except (OSError, zipfile.BadZipFile, NotImplementedError, ValueError, struct.error):
        return frozenset()


def npy_shape(path: Path) -> tuple[int, ...]:
    """The shape that an npy claims to have; () where it is no such file."""
    try:
        with path.open("rb") as file:
            header = file.read(_MAX_HEADER).decode("latin-1")
    except OSError:
        return ()
    found = re.search(r"'shape': \((\d{1,15}(?:, ?\d{1,15})*),?\)", header)
    plain = header.startswith(_MAGIC.decode("latin-1")) and found is not None
    return tuple(map(int, found[1].split(","))) if plain and found else ()


def read_npy(path: Path) -> np.ndarray:
    """The one array of an npy. Raises `FileFormatError` where it is none, or holds a pickle."""
    try:
        array = _parse(path.read_bytes(), path, None)
    except OSError as error:
        raise FileFormatError(path, None, f"can't be read ({error.strerror or error})") from error
    if array is None:
        raise FileFormatError(
            path,
            None,
            "holds Python objects (a pickle, which can run any program), not plain numbers; save "
            "the array that is meant with numpy.save(..., allow_pickle=False)",
        )
    return array


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


def _parse(data: bytes, path: Path, name: str | None) -> np.ndarray | None:
    """An array in the bytes of an npy; None where it is one of Python objects.

    The header is numpy's: a dict with the dtype, the order and the shape, as Python writes them.
    """

    def fail(what: str) -> NoReturn:
        raise FileFormatError(path, None, what if name is None else f"{name!r} {what}")

    if not data:
        fail("is empty; expected an array")
    if not data.startswith(_MAGIC) or len(data) < 12:
        fail("is no array of numpy's")
    wide = data[6] > 1
    (length,) = struct.unpack_from("<I" if wide else "<H", data, 8)
    start = (12 if wide else 10) + length
    if length > _MAX_HEADER or start > len(data):
        fail("has a broken header")
    try:
        header = ast.literal_eval(data[12 if wide else 10 : start].decode("latin-1"))
        shape, by_columns = tuple(header["shape"]), bool(header["fortran_order"])
        dtype = np.dtype(header["descr"])
        count = math.prod(shape)
        if not all(type(side) is int and side >= 0 for side in shape):
            raise ValueError(f"shape {shape}")
    except (ValueError, SyntaxError, TypeError, KeyError, RecursionError, MemoryError) as error:
        fail(f"has a header that can't be read ({error})")
    if dtype.hasobject:
        return None
    if count * dtype.itemsize != len(data) - start or not dtype.itemsize:
        fail(
            f"has {len(data) - start} bytes for {' x '.join(map(str, shape))} values of "
            f"{dtype}: it is cut short, or broken"
        )
    array = np.frombuffer(data, dtype, count, start)
    return array.reshape(shape[::-1]).T if by_columns else array.reshape(shape)


def held(arrays: Arrays) -> str:
    """What the file holds, for messages."""
    names = [f"{name} {'x'.join(map(str, array.shape))}" for name, array in arrays.items()]
    pickled = f", and Python objects ({name_list(list(arrays.pickled))})" if arrays.pickled else ""
    return (", ".join(names[:12]) or "nothing") + pickled
