"""Arrays in an npz, read without trust: no pickle, and no memory that the file only claims to need.

An npz is a zip of npy files. Sizes stand in three places that need not agree (the zip's directory,
each array's header, the data), and compressed data may be a thousandth of what it grows to. So an
array is read when it is asked for, only where all three agree, and all together take no more than a
multiple of the file.
"""

import io
import re
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NoReturn

import numpy as np

from spark.errors import FileFormatError
from spark.opening import read_bytes
from spark.plain_pickle import array_of, first_line, plain_value

_BASE, _RATIO = 128 << 20, 4  # bytes that arrays may take, and how many more for each of the file's
_HEADER = 10_000  # bytes of an array's header, as numpy allows at most
_SMALL = 4096  # bytes of an array of one Python object, such as a number
_OBJECTS = re.compile(rb"'descr'\s*:.*[<>|=]?O\d?'", re.DOTALL)
# A header is the text of a Python dict; what else may stand in one needs pickle.
_FIELDS = (
    re.compile(rb"'descr'\s*:\s*'([<>|=]?(?:b1|[iu][1248]|f[248]|c(?:8|16)|[SU][1-9]\d{0,5}))'"),
    re.compile(rb"'fortran_order'\s*:\s*(True|False)"),
    re.compile(rb"'shape'\s*:\s*\(([\d\s,L]*)\)"),
)


class Npz(Mapping[str, np.ndarray]):
    """The arrays of an npz by their names; each is read when it is asked for.

    Raises `FileFormatError` where the file is none, and where an array can't be read: it is broken
    or encrypted, holds objects (which only pickle reads), or is larger than the file can mean.
    """

    def __init__(self, path: Path, *, expected: str) -> None:
        self.path, self._expected = path, expected
        content = read_bytes(path, expected=expected)
        if not content:
            self._fail("is empty")
        if content.startswith(b"\x93NUMPY"):
            self._fail("is a single array, no npz of several")
        self._limit = _BASE + _RATIO * len(content)
        self._taken: dict[str, int] = {}
        try:
            self._zip = zipfile.ZipFile(io.BytesIO(content))
        except (zipfile.BadZipFile, ValueError, OverflowError, NotImplementedError) as error:
            self._fail(f"is no npz ({error})", error)
        self._members = {
            info.filename.removesuffix(".npy"): info
            for info in self._zip.infolist()
            if info.filename.endswith(".npy")
        }

    @property
    def pickled(self) -> tuple[str, ...]:
        """The arrays of Python objects, which are read by running the pickles in them: not here."""
        return tuple(name for name in self if holds_objects(self._content(name, _HEADER)))

    def lone_value(self, name: str) -> np.ndarray | None:
        """The one number or text in an array of Python objects, whose pickle is not run; None where
        it holds anything else."""
        data = self._content(name, _SMALL + 1)
        try:
            return None if len(data) > _SMALL else plain_value(bytes(_split(data)[1]))
        except ValueError:
            return None

    def __getitem__(self, name: str) -> np.ndarray:
        info = self._members[name]
        self._taken[name] = info.file_size
        if sum(self._taken.values()) > self._limit:
            self._fail(
                f"{name!r} takes {info.file_size / 2**20:.0f} MB, far more than such a file holds"
            )
        data = self._content(name, info.file_size)
        try:
            return array_in(data)
        except (ValueError, MemoryError) as error:
            self._fail(f"{name!r} can't be read ({first_line(error)})", error)

    def __iter__(self) -> Iterator[str]:
        return iter(self._members)

    def __len__(self) -> int:
        return len(self._members)

    def _content(self, name: str, size: int) -> bytes:
        """The first `size` bytes of a member."""
        info = self._members[name]
        if info.flag_bits & 1:
            self._fail(f"{name!r} is encrypted")
        if info.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            self._fail(f"{name!r} is compressed in a way that npz files are not")
        try:
            with self._zip.open(info) as member:
                return member.read(size)
        except (
            *(ValueError, EOFError, OSError, NotImplementedError, RuntimeError),
            *(zipfile.BadZipFile, zlib.error, MemoryError),
        ) as error:
            self._fail(f"{name!r} can't be read ({first_line(error)})", error)

    def _fail(self, message: str, cause: Exception | None = None) -> NoReturn:
        raise FileFormatError(self.path, None, f"{message}; expected {self._expected}") from cause


def array_in(data: bytes) -> np.ndarray:
    """The array in the bytes of an npy file, which its header must describe to the byte. Raises
    `ValueError` where it doesn't, or where the array is not one of plain numbers or text."""
    header, content = _split(data)
    found = [field.search(header) for field in _FIELDS]
    if None in found:
        raise ValueError("its header describes no array of plain numbers or text")
    kind, order, lengths = (field[1].decode() for field in found if field)
    shape = tuple(int(n) for n in re.findall(r"\d+", lengths))
    dtype = np.dtype(kind)
    array = array_of(content, dtype, shape, "F" if order == "True" else "C")
    if dtype.kind == "U" and not _is_text(np.frombuffer(content, f"{dtype.byteorder}u4")):
        raise ValueError("its text holds what is no letter")
    return array


def _is_text(codes: np.ndarray) -> bool:
    """Whether all are code points of Unicode: Python's text breaks on others."""
    return not ((codes > 0x10FFFF) | ((codes >= 0xD800) & (codes < 0xE000))).any()


def holds_objects(data: bytes) -> bool:
    """Whether an npy file that begins with `data` is an array of Python objects."""
    try:
        header, _ = _split(data)
    except ValueError:
        return False
    return _OBJECTS.search(header) is not None


def _split(data: bytes) -> tuple[bytes, memoryview]:
    """The header and the rest of an npy file."""
    if data[:6] != b"\x93NUMPY" or len(data) < 12:
        raise ValueError("it is no npy file")
    start = 12 if data[6] > 1 else 10  # version 1 has a header of at most 64 kB
    length = int.from_bytes(data[8:start], "little")
    if not 0 < length <= min(_HEADER, len(data) - start):
        raise ValueError(f"its header is broken, or has {length} bytes")
    return data[start : start + length], memoryview(data)[start + length :]
