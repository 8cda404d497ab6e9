"""Tensors in files of `torch.save`, read without torch and without running the pickle inside.

The file is a zip: `data.pkl` says what there is, and `data/0`, `data/1`, ... hold the numbers. The
pickle's instructions are walked over one by one; those that make dicts, lists and tensors are
followed, and whatever else they would call becomes an `Unknown`.
"""

import struct
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from spark.errors import FileFormatError
from spark.opening import beginning, check_regular
from spark.pickle_machine import Name, PickleMachine, RefusedError

_MAX_PICKLE = 1 << 26  # bytes: it says what there is; the numbers lie beside it
_MAX_UNPACKED = 1 << 26  # bytes of what is packed, which torch never does
_MAX_REPEATED = 10_000_000  # numbers of a tensor that repeats those of its storage (stride 0)
_LEGACY = b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19."  # how torch before 1.6 begins a file
STORAGES = {
    "FloatStorage": "<f4",
    "DoubleStorage": "<f8",
    "HalfStorage": "<f2",
    "LongStorage": "<i8",
    "IntStorage": "<i4",
    "ShortStorage": "<i2",
    "CharStorage": "<i1",
    "ByteStorage": "<u1",
    "BoolStorage": "?",
}
"""What torch calls the storages of numbers, and numpy their kinds."""
_CONTAINERS = {"collections OrderedDict": dict, "builtins dict": dict, "builtins list": list}
_TENSORS = {"torch._utils _rebuild_tensor_v2", "torch._utils _rebuild_tensor"}
_PARAMETER = "torch._utils _rebuild_parameter"


@dataclass(frozen=True)
class Unknown:
    """What a pickle would import or call: a name, and nothing that happens."""

    name: str


@dataclass(frozen=True)
class Tensor:
    """Where a tensor's numbers lie; `array` reads them."""

    path: Path
    storage: str
    dtype: str
    offset: int
    shape: tuple[int, ...]
    strides: tuple[int, ...]

    def array(self) -> np.ndarray:
        """The numbers. Raises `FileFormatError` where the file does not hold them."""
        with zipfile.ZipFile(self.path) as stored:
            member = _member(stored, f"data/{self.storage}", self.path)
            data = _unpacked(stored, member, self.path)
        kind = np.dtype(self.dtype)
        flat = np.frombuffer(data, kind, count=len(data) // kind.itemsize)
        last = self.offset + sum((n - 1) * s for n, s in zip(self.shape, self.strides, strict=True))
        if 0 in self.shape:
            return np.zeros(self.shape, self.dtype)
        if last >= len(flat):
            raise FileFormatError(
                self.path, None, f"tensor {self.shape} ends beyond its {len(flat)} numbers"
            )
        strides = tuple(s * flat.itemsize for s in self.strides)
        view = np.lib.stride_tricks.as_strided(flat[self.offset :], self.shape, strides)
        if view.size > max(len(flat), _MAX_REPEATED):
            raise FileFormatError(self.path, None, f"tensor {self.shape} repeats its numbers")
        return view.copy()


def says(path: Path, words: tuple[bytes, ...]) -> bool:
    """Whether a file of `torch.save` has one of these names in it."""
    try:
        check_regular(path)
        with zipfile.ZipFile(path) as stored:
            member = _member(stored, "data.pkl", path)
            if member.file_size > _MAX_PICKLE:
                return False
            pickle = _unpacked(stored, member, path)
    except (
        *(FileFormatError, OSError, ValueError, struct.error),
        *(zipfile.BadZipFile, NotImplementedError, IndexError),
    ):
        return False
    return any(word in pickle for word in words)


def read_tensors(path: Path) -> Any:
    """What `torch.save` was given: dicts, lists, numbers, text, `Tensor` and `Unknown`.

    Raises `FileFormatError` where the file is none of torch's, or broken.
    """
    check_regular(path, expected="a motion")
    if beginning(path, len(_LEGACY)) == _LEGACY:
        raise FileFormatError(
            path, None, "was saved by torch before 1.6; load it there and save it again"
        )
    try:
        with zipfile.ZipFile(path) as stored:
            member = _member(stored, "data.pkl", path)
            if member.file_size > _MAX_PICKLE:
                raise FileFormatError(path, None, "describes more than a motion")
            return _TorchMachine(path).run(_unpacked(stored, member, path))
    except OSError as error:
        raise FileFormatError(path, None, f"can't be read ({error.strerror or error})") from error
    except (zipfile.BadZipFile, NotImplementedError, ValueError) as error:
        raise FileFormatError(path, None, f"is no file of torch.save ({error})") from error
    except RefusedError as error:
        raise FileFormatError(path, None, f"{error}; expected a motion") from error
    except (
        *(IndexError, KeyError, TypeError, AttributeError, RecursionError),
        *(AssertionError, OverflowError, MemoryError),
    ) as error:
        raise FileFormatError(
            path, None, f"holds a broken pickle ({type(error).__name__}: {error})"
        ) from error


def _member(stored: zipfile.ZipFile, ending: str, path: Path) -> zipfile.ZipInfo:
    """The member below the file's one folder."""
    for member in stored.infolist():
        if member.filename.partition("/")[2] == ending:
            return member
    raise FileFormatError(path, None, f"has no {ending!r}; expected a file of torch.save")


def _unpacked(stored: zipfile.ZipFile, member: zipfile.ZipInfo, path: Path) -> bytes:
    if member.compress_type != zipfile.ZIP_STORED and member.file_size > _MAX_UNPACKED:
        raise FileFormatError(
            path, None, f"{member.filename} is packed, which torch never does; save it again"
        )
    try:
        return stored.read(member)
    except Exception as error:  # spoilt zips fail in many ways: OSError, ...
        raise FileFormatError(path, None, f"{member.filename} is broken ({error})") from error


class _TorchMachine(PickleMachine):
    """Follows what makes dicts, lists and tensors; other calls are not made."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path

    def call(self, called: Any, arguments: Any) -> Any:
        return _made(called, arguments, self.path)

    def build(self, made: Any, state: Any) -> None:
        """States are of no use here."""

    def persistent(self, key: Any) -> Any:
        return ("storage", key)


def _made(callee: Any, arguments: Any, path: Path) -> Any:
    """What a call gives, for the few that are known."""
    name = f"{callee.module} {callee.name}" if isinstance(callee, Name) else type(callee).__name__
    if name in _CONTAINERS:
        return _CONTAINERS[name]()
    if name == _PARAMETER:
        return arguments[0]
    if name not in _TENSORS:
        return Unknown(name)
    (_, (_, kind, key, *_)), offset, shape, strides, *_ = arguments
    dtype = STORAGES.get(kind.name)
    numbers = (offset, *shape, *strides)
    if dtype is None or not all(type(n) is int and n >= 0 for n in numbers):
        return Unknown(f"tensor of {kind.name}")
    return Tensor(path, str(key), dtype, offset, tuple(shape), tuple(strides))
