"""Tensors in files of `torch.save`, read without torch and without running the pickle inside.

The file is a zip: `data.pkl` says what there is, and `data/0`, `data/1`, ... hold the numbers. The
pickle's instructions are walked over one by one; those that make dicts, lists and tensors are
followed, and whatever else they would call becomes an `Unknown`.
"""

import pickletools
import zipfile
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from spark.errors import FileFormatError

_MAX_PICKLE = 1 << 26  # bytes: it says what there is; the numbers lie beside it
_MAX_STORAGE = 1 << 32  # bytes of one tensor
_MAX_REPEATED = 10_000_000  # numbers of a tensor that repeats those of its storage (stride 0)
_LEGACY = b"\x80\x02\x8a\nl\xfc\x9cF\xf9 j\xa8P\x19."  # how torch before 1.6 begins a file
_DTYPES = {
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
            if member.file_size > _MAX_STORAGE:
                raise FileFormatError(self.path, None, "holds a tensor beyond 4 GB")
            flat = np.frombuffer(_unpacked(stored, member, self.path), self.dtype)
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
        with zipfile.ZipFile(path) as stored:
            member = _member(stored, "data.pkl", path)
            if member.file_size > _MAX_PICKLE:
                return False
            pickle = _unpacked(stored, member, path)
    except (OSError, zipfile.BadZipFile, NotImplementedError, ValueError, FileFormatError):
        return False
    return any(word in pickle for word in words)


def read_tensors(path: Path) -> Any:
    """What `torch.save` was given: dicts, lists, numbers, text, `Tensor` and `Unknown`.

    Raises `FileFormatError` where the file is none of torch's, or broken.
    """
    try:
        with path.open("rb") as file:
            if file.read(len(_LEGACY)) == _LEGACY:
                raise FileFormatError(
                    path, None, "was saved by torch before 1.6; load it there and save it again"
                )
        with zipfile.ZipFile(path) as stored:
            member = _member(stored, "data.pkl", path)
            if member.file_size > _MAX_PICKLE:
                raise FileFormatError(path, None, "describes more than a motion")
            return _follow(_unpacked(stored, member, path), path)
    except OSError as error:
        raise FileFormatError(path, None, f"can't be read ({error.strerror or error})") from error
    except (zipfile.BadZipFile, NotImplementedError, ValueError) as error:
        raise FileFormatError(path, None, f"is no file of torch.save ({error})") from error
    except (IndexError, KeyError, TypeError, AttributeError, RecursionError) as error:
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
    try:
        return stored.read(member)
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, NotImplementedError) as error:
        raise FileFormatError(path, None, f"{member.filename} is broken ({error})") from error


_MARK = Unknown("mark")


def _follow(pickle: bytes, path: Path) -> Any:
    """The value that the instructions describe; calls other than those of tensors are not made."""
    stack: list[Any] = []
    memo: dict[int, Any] = {}

    def to_mark() -> list[Any]:
        at = len(stack) - 1
        while stack[at] is not _MARK:
            at -= 1
            if at < 0:
                raise IndexError("no mark")
        items = stack[at + 1 :]
        del stack[at:]
        return items

    argument: Any
    for opcode, argument, _ in pickletools.genops(pickle):
        match opcode.name:
            case "PROTO" | "FRAME":
                pass
            case "STOP":
                return stack.pop()
            case "MARK":
                stack.append(_MARK)
            case "NONE":
                stack.append(None)
            case "NEWTRUE":
                stack.append(True)
            case "NEWFALSE":
                stack.append(False)
            case "EMPTY_DICT":
                stack.append({})
            case "EMPTY_LIST":
                stack.append([])
            case "EMPTY_TUPLE":
                stack.append(())
            case "TUPLE":
                stack.append(tuple(to_mark()))
            case "LIST":
                stack.append(to_mark())
            case "DICT":
                items = to_mark()
                stack.append(dict(zip(items[::2], items[1::2], strict=True)))
            case "TUPLE1" | "TUPLE2" | "TUPLE3":
                count = int(opcode.name[-1])
                items = stack[-count:]
                del stack[-count:]
                stack.append(tuple(items))
            case "APPEND":
                item = stack.pop()
                _append(stack[-1], [item])
            case "APPENDS":
                items = to_mark()
                _append(stack[-1], items)
            case "SETITEM":
                value, key = stack.pop(), stack.pop()
                _update(stack[-1], [key, value])
            case "SETITEMS":
                items = to_mark()
                _update(stack[-1], items)
            case "POP":
                stack.pop()
            case "POP_MARK":
                to_mark()
            case "DUP":
                stack.append(stack[-1])
            case "PUT" | "BINPUT" | "LONG_BINPUT":
                memo[int(argument)] = stack[-1]
            case "MEMOIZE":
                memo[len(memo)] = stack[-1]
            case "GET" | "BINGET" | "LONG_BINGET":
                stack.append(memo[int(argument)])
            case "GLOBAL":
                stack.append(Unknown(str(argument)))
            case "STACK_GLOBAL":
                name, module = stack.pop(), stack.pop()
                stack.append(Unknown(f"{module} {name}"))
            case "BINPERSID":
                stack.append(("storage", stack.pop()))
            case "REDUCE" | "NEWOBJ":
                arguments, callee = stack.pop(), stack.pop()
                stack.append(_made(callee, arguments, path))
            case "BUILD":
                stack.pop()
            case name if argument is not None and name.startswith(
                ("BIN", "INT", "LONG", "FLOAT", "SHORT", "UNICODE", "STRING")
            ):
                stack.append(argument)
            case name:
                raise FileFormatError(
                    path, None, f"has a pickle with {name}, which no motion needs; it is not read"
                )
    raise ValueError("the pickle has no end")


def _append(target: Any, items: list[Any]) -> None:
    if isinstance(target, list):
        target += items


def _update(target: Any, items: list[Any]) -> None:
    if isinstance(target, dict):
        target.update(zip(items[::2], items[1::2], strict=True))


def _made(callee: Any, arguments: Any, path: Path) -> Any:
    """What a call gives, for the few that are known."""
    name = callee.name if isinstance(callee, Unknown) else str(callee)
    if name in _CONTAINERS:
        return _CONTAINERS[name]()
    if name == _PARAMETER:
        return arguments[0]
    if name not in _TENSORS:
        return Unknown(name)
    (_, (_, kind, key, *_)), offset, shape, strides, *_ = arguments
    dtype = _DTYPES.get(kind.name.rpartition(" ")[2])
    numbers = (offset, *shape, *strides)
    if dtype is None or not all(type(n) is int and n >= 0 for n in numbers):
        return Unknown(f"tensor of {kind.name}")
    return Tensor(path, str(key), dtype, offset, tuple(shape), tuple(strides))
