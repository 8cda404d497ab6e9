"""The plain values of a pickle, without running it.

A pickle is a program: it calls what it names, and even numpy's own arrays can be given a state that
crashes the interpreter. So its opcodes are walked here, and make dicts, lists, texts, numbers and
arrays of plain numbers, whose bytes must be as many as their shape says. Whatever else it does is
refused. The opcodes are those of Python's `pickletools`.
"""

import pickletools
import re
from collections.abc import Callable
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from spark.errors import FileFormatError
from spark.opening import read_bytes

_LARGEST = 300_000  # opcodes: numbers in lists take one or two each, arrays a few
_DTYPE = re.compile(r"[<>|=]?(b1|[iu][1248]|f[248]|[SU][1-9]\d{0,5})")


class _RefusedError(Exception):
    """What a pickle does that plain values don't need."""


def read_plain_pickle(path: Path, *, expected: str) -> Any:
    """The value that the pickle at `path` stands for.

    Raises `FileFormatError` where it is broken, or asks for anything but plain values and arrays.
    """
    data = read_bytes(path, expected=expected)
    try:
        return _Machine().run(data)
    except _RefusedError as error:
        raise FileFormatError(path, None, f"{error}; expected {expected}") from error
    except Exception as error:  # broken pickles fail in any way: it is a small machine's program
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise FileFormatError(
            path, None, f"is no pickle ({reason}); expected {expected}"
        ) from error


@dataclass(frozen=True)
class _Name:
    """Something that a pickle would import."""

    module: str
    name: str

    def __str__(self) -> str:
        return f"{self.module}.{self.name}"


@dataclass
class _Dtype:
    """numpy.dtype: a kind and size, such as f8, and then a byte order."""

    kind: str
    order: str = "="

    def made(self) -> np.dtype[Any]:
        text = self.kind if self.kind[:1] in "<>|=" else self.order + self.kind
        if not _DTYPE.fullmatch(text):
            raise _RefusedError(f"holds an array of {self.kind[:20]!r}, which are no plain numbers")
        return np.dtype(text)


class _Array:
    """numpy.ndarray, empty before its state is known."""

    value: np.ndarray | None = None


class _Machine:
    """Stack, marks and memo of the pickle machine."""

    def __init__(self) -> None:
        self.stack: list[Any] = []
        self.marks: list[int] = []
        self.memo: dict[int, Any] = {}

    def run(self, data: bytes) -> Any:
        for count, (opcode, argument, _) in enumerate(pickletools.genops(data)):
            if count > _LARGEST:
                raise _RefusedError(f"has more than {_LARGEST:,} values beside its arrays")
            name = opcode.name
            if name == "STOP":
                return _plain(self.pop())
            if name in _CONSTANTS:
                self.stack.append(_CONSTANTS[name](argument))
            elif name in _ACTIONS:
                _ACTIONS[name](self, argument)
            elif name not in _NOTHING:
                raise _RefusedError(f"uses the opcode {name}, which no plain values need")
        raise ValueError("it has no end")

    def pop(self) -> Any:
        if not self.stack or (self.marks and self.marks[-1] == len(self.stack)):
            raise ValueError("its stack is empty")
        return self.stack.pop()

    def top(self, kind: type) -> Any:
        if not self.stack or not isinstance(self.stack[-1], kind):
            raise ValueError(f"there is no {kind.__name__} where it needs one")
        return self.stack[-1]

    def above_mark(self) -> list[Any]:
        at = self.marks.pop()
        items = self.stack[at:]
        del self.stack[at:]
        return items

    def take(self, count: int) -> tuple[Any, ...]:
        return tuple(reversed([self.pop() for _ in range(count)]))

    def mark(self, _: object) -> None:
        self.marks.append(len(self.stack))

    def put(self, key: int) -> None:
        self.memo[key] = self.stack[-1]

    def get(self, key: int) -> None:
        self.stack.append(self.memo[key])

    def extend(self, items: list[Any]) -> None:
        self.top(list).extend(items)

    def update(self, items: list[Any]) -> None:
        self.top(dict).update(_pairs(items))

    def stack_global(self, _: object) -> None:
        module, name = self.take(2)
        self.stack.append(_Name(str(module), str(name)))

    def reduce(self, _: object) -> None:
        called, arguments = self.take(2)
        self.stack.append(_call(called, arguments))

    def build(self, _: object) -> None:
        state, made = self.pop(), self.stack[-1]
        if isinstance(made, _Dtype):
            made.order = str(state[1])
        elif isinstance(made, _Array):
            _, shape, dtype, columns, content = state
            made.value = _array(dtype, shape, content, "F" if columns else "C")
        else:
            raise _RefusedError(f"gives a state to a {type(made).__name__}, which has none")


_NOTHING = {"PROTO", "FRAME"}
_CONSTANTS: dict[str, Callable[[Any], Any]] = {
    **dict.fromkeys(
        (
            *("INT", "BININT", "BININT1", "BININT2", "LONG", "LONG1", "LONG4"),
            *("FLOAT", "BINFLOAT", "STRING", "BINSTRING", "SHORT_BINSTRING"),
            *("UNICODE", "BINUNICODE", "SHORT_BINUNICODE", "BINUNICODE8"),
            *("BINBYTES", "SHORT_BINBYTES", "BINBYTES8", "BYTEARRAY8"),
        ),
        lambda value: value,
    ),
    "NONE": lambda _: None,
    "NEWTRUE": lambda _: True,
    "NEWFALSE": lambda _: False,
    "EMPTY_LIST": lambda _: [],
    "EMPTY_TUPLE": lambda _: (),
    "EMPTY_DICT": lambda _: {},
    "GLOBAL": lambda names: _Name(*names.split(" ", 1)),
}
_ACTIONS: dict[str, Callable[[_Machine, Any], Any]] = {
    "MARK": _Machine.mark,
    "POP": lambda m, _: m.marks.pop() if m.marks and m.marks[-1] == len(m.stack) else m.pop(),
    "POP_MARK": lambda m, _: m.above_mark(),
    "DUP": lambda m, _: m.stack.append(m.stack[-1]),
    **dict.fromkeys(("PUT", "BINPUT", "LONG_BINPUT"), _Machine.put),
    "MEMOIZE": lambda m, _: m.put(len(m.memo)),
    **dict.fromkeys(("GET", "BINGET", "LONG_BINGET"), _Machine.get),
    "TUPLE": lambda m, _: m.stack.append(tuple(m.above_mark())),
    "TUPLE1": lambda m, _: m.stack.append(m.take(1)),
    "TUPLE2": lambda m, _: m.stack.append(m.take(2)),
    "TUPLE3": lambda m, _: m.stack.append(m.take(3)),
    "LIST": lambda m, _: m.stack.append(m.above_mark()),
    "APPEND": lambda m, _: m.extend([m.pop()]),
    "APPENDS": lambda m, _: m.extend(m.above_mark()),
    "DICT": lambda m, _: m.stack.append(dict(_pairs(m.above_mark()))),
    "SETITEM": lambda m, _: m.update(list(m.take(2))),
    "SETITEMS": lambda m, _: m.update(m.above_mark()),
    "STACK_GLOBAL": _Machine.stack_global,
    "REDUCE": _Machine.reduce,
    "BUILD": _Machine.build,
}


def _call(called: Any, arguments: Any) -> Any:
    """What the few functions give that numpy's pickles call; `arguments` are a tuple."""
    if not isinstance(called, _Name) or not isinstance(arguments, tuple):
        raise ValueError("it calls what is no function")
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
            return text.encode("latin-1")
        case ("__builtin__" | "builtins", "bytes"), ():
            return b""
    raise _RefusedError(
        f"wants to load {called}, which no motion needs; a pickle can run any program, so this one "
        "is not read"
    )


def _array(dtype: Any, shape: Any, content: Any, order: Any) -> np.ndarray:
    if isinstance(content, str):  # of Python 2
        content = content.encode("latin-1")
    if not isinstance(dtype, _Dtype) or not isinstance(content, bytes | bytearray):
        raise _RefusedError("holds an array of objects, which are no plain numbers")
    kind = dtype.made()
    if not (isinstance(shape, tuple) and all(type(n) is int and n >= 0 for n in shape)):
        raise ValueError("the shape of an array is none")
    if len(shape) > 8 or prod(shape) * kind.itemsize != len(content):
        raise ValueError(f"{len(content)} bytes are no array of shape {str(shape)[:80]}")
    return np.frombuffer(bytes(content) or bytes(kind.itemsize), kind)[: prod(shape)].reshape(
        shape, order=order
    )


def _pairs(items: list[Any]) -> list[tuple[str | int, Any]]:
    """Keys with their values."""
    if len(items) % 2 or not all(isinstance(key, str | int) for key in items[::2]):
        raise _RefusedError("has a dict whose keys are no names")
    return list(zip(items[::2], items[1::2], strict=True))


def _plain(value: Any) -> Any:
    """The value, where it is one, with arrays for what stands for them."""
    if isinstance(value, dict):
        return {key: _plain_entry(entry) for key, entry in value.items()}
    return _plain_entry(value)


def _plain_entry(value: Any) -> Any:
    if isinstance(value, _Array) and value.value is not None:
        return value.value
    if isinstance(value, _Array | _Dtype | _Name):
        raise ValueError("an array has no numbers")
    return value
