"""The plain values of a pickle, without running it.

A pickle is a program: it calls what it names, and even numpy's own arrays can be given a state that
crashes the interpreter. Here it makes plain values, and arrays of plain numbers whose bytes are as
many as their shape says. Whatever else it does is refused.
"""

import re
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any, Literal

import numpy as np

from spark.errors import FileFormatError
from spark.opening import read_bytes
from spark.pickle_machine import Name, PickleMachine, RefusedError

_DTYPE = re.compile(r"[<>|=]?(b1|[iu][1248]|f[248]|[SU][1-9]\d{0,5})")


def read_plain_pickle(path: Path, *, expected: str) -> Any:
    """The value that the pickle at `path` stands for.

    Raises `FileFormatError` where it is broken, or asks for anything but plain values and arrays.
    """
    data = read_bytes(path, expected=expected)
    try:
        return _plain(_NumpyMachine(len(data)).run(data))
    except RefusedError as error:
        raise FileFormatError(path, None, f"{error}; expected {expected}") from error
    except Exception as error:  # broken pickles fail in any way: it is a small machine's program
        raise FileFormatError(
            path, None, f"is no pickle ({first_line(error)}); expected {expected}"
        ) from error


def plain_value(data: bytes) -> np.ndarray | None:
    """The one number or text in the pickle of an array of objects; None for anything else."""
    try:
        value = _plain(_NumpyMachine(len(data), objects=True).run(data))
    except Exception:  # as above
        return None
    return value if isinstance(value, np.ndarray) else None


@dataclass
class _Dtype:
    """numpy.dtype: a kind and size, such as f8, and then a byte order."""

    kind: str
    order: str = "="

    def made(self) -> np.dtype[Any]:
        text = self.kind if self.kind[:1] in "<>|=" else self.order + self.kind
        if not _DTYPE.fullmatch(text):
            raise RefusedError(f"holds an array of {self.kind[:20]!r}, which are no plain numbers")
        return np.dtype(text)


class _Array:
    """numpy.ndarray, empty before its state is known."""

    value: np.ndarray | None = None


class _NumpyMachine(PickleMachine):
    """Knows the few functions that numpy's pickles call."""

    def __init__(self, size: int, *, objects: bool = False) -> None:
        super().__init__()
        self._left = 4 * size  # characters to encode: one text may be asked for again and again
        self._objects = objects

    def call(self, called: Any, arguments: Any) -> Any:
        if not isinstance(called, Name):
            return self.refuse(called)
        package = called.module.replace("numpy.core", "numpy._core")
        match (package, called.name), arguments:
            case ("numpy._core.multiarray", "_reconstruct"), _:
                return _Array()
            case ("numpy", "dtype"), (str(kind), *_):
                return _Dtype(kind)
            case ("numpy._core.multiarray", "scalar"), (dtype, content):
                return _array(dtype, (), content, "C")[()]
            case ("numpy._core.numeric", "_frombuffer"), (content, dtype, shape, order):
                return _array(dtype, shape, content, "F" if order == "F" else "C")
            case ("_codecs", "encode"), (str(text), *_):  # bytes, in the older protocols
                self._left -= len(text)
                if self._left < 0:
                    raise RefusedError("makes more of its bytes than it has")
                return text.encode("latin-1")
            case ("__builtin__" | "builtins", "bytes"), ():
                return b""
        return self.refuse(called)

    def build(self, made: Any, state: Any) -> None:
        if isinstance(made, _Dtype):
            made.order = str(state[1])
        elif isinstance(made, _Array):
            _, shape, dtype, columns, content = state
            if self._objects and isinstance(content, list) and len(content) == 1:
                made.value = _lone(content[0])
                return
            made.value = _array(dtype, shape, content, "F" if columns else "C")
        else:
            super().build(made, state)


def _array(dtype: Any, shape: Any, content: Any, order: Literal["C", "F"]) -> np.ndarray:
    if isinstance(content, str):  # of Python 2
        content = content.encode("latin-1")
    if not isinstance(dtype, _Dtype) or not isinstance(content, bytes | bytearray):
        raise RefusedError("holds an array of objects, which are no plain numbers")
    kind = dtype.made()
    if not (isinstance(shape, tuple) and all(type(n) is int and n >= 0 for n in shape)):
        raise ValueError("the shape of an array is none")
    return array_of(content, kind, shape, order)


def array_of(
    content: bytes | bytearray | memoryview,
    dtype: np.dtype[Any],
    shape: tuple[int, ...],
    order: Literal["C", "F"],
) -> np.ndarray:
    """The array of these bytes. Raises `ValueError` where they are not as many as its shape says,
    or it has more axes than any that is meant."""
    if len(shape) > 8 or prod(shape) * dtype.itemsize != len(content):
        raise ValueError(f"{len(content)} bytes are no array of shape {str(shape)[:80]}")
    array = np.frombuffer(content, dtype) if len(content) else np.zeros(0, dtype)
    return array.reshape(shape, order=order)


def first_line(error: BaseException) -> str:
    """What an error says, or else is."""
    return str(error).splitlines()[0] if str(error) else type(error).__name__


def _lone(value: Any) -> np.ndarray:
    """One number or text as an array of one."""
    value = _plain_entry(value)
    if isinstance(value, np.ndarray | np.generic) and value.size == 1:
        value = value.ravel()[0].item()
    if type(value) not in (bool, int, float, str, bytes):
        raise RefusedError("holds an array of objects, which are no plain numbers")
    return np.array([value])


def _plain(value: Any) -> Any:
    """The value, where it is one, with arrays for what stands for them."""
    if isinstance(value, dict):
        return {key: _plain_entry(entry) for key, entry in value.items()}
    return _plain_entry(value)


def _plain_entry(value: Any) -> Any:
    if isinstance(value, _Array) and value.value is not None:
        return value.value
    if isinstance(value, _Array | _Dtype | Name):
        raise ValueError("an array has no numbers")
    return value
