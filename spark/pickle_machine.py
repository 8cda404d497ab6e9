"""The machine that pickles are programs of, walked without running any.

Its opcodes (Python's `pickletools`) make plain values: dicts with names as keys, lists, tuples,
texts, bytes and numbers. What a pickle would import, call or give a state is for a subclass to say,
as in `pickle.Unpickler`; by itself the machine refuses it.
"""

import pickletools
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NoReturn

# More take seconds. Numbers in lists take one or two opcodes each, arrays a few.
LARGEST = 300_000


class RefusedError(Exception):
    """What a pickle does that plain values don't need."""


@dataclass(frozen=True)
class Name:
    """Something that a pickle would import."""

    module: str
    name: str

    def __str__(self) -> str:
        return f"{self.module}.{self.name}"


class PickleMachine:
    """Stack, marks and memo. A broken pickle raises any exception, but it raises."""

    def __init__(self) -> None:
        self.stack: list[Any] = []
        self.marks: list[int] = []
        self.memo: dict[int, Any] = {}

    def call(self, called: Any, arguments: Any) -> Any:
        """What calling something gives, a `Name` as a rule."""
        self.refuse(called)

    def build(self, made: Any, state: Any) -> None:
        """Give a state to what a call made."""
        raise RefusedError(f"gives a state to a {type(made).__name__}, which has none")

    def persistent(self, key: Any) -> Any:
        """What stands outside the pickle."""
        raise RefusedError("has parts outside the file")

    def refuse(self, called: Any) -> NoReturn:
        """Say that something is not called."""
        if not isinstance(called, Name):
            raise ValueError("it calls what is no function")
        raise RefusedError(
            f"wants to load {called}, which no motion needs; a pickle can run any program, so this "
            "one is not read"
        )

    def run(self, data: bytes) -> Any:
        """The value that a pickle stands for."""
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            try:
                return self._run(data)
            except Warning as warning:  # of an escape in a text that no pickle writes
                raise ValueError(str(warning)) from warning

    def _run(self, data: bytes) -> Any:
        for count, (opcode, argument, _) in enumerate(pickletools.genops(data)):
            if count > LARGEST:
                raise RefusedError(f"has more than {LARGEST:,} values beside its arrays")
            name = opcode.name
            if name == "STOP":
                return self.pop()
            if name in _CONSTANTS:
                self.stack.append(_CONSTANTS[name](argument))
            elif name in _ACTIONS:
                _ACTIONS[name](self, argument)
            elif name not in _NOTHING:
                raise RefusedError(f"uses the opcode {name}, which no plain values need")
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
        self.top(dict).update(pairs(items))

    def stack_global(self, _: object) -> None:
        module, name = self.take(2)
        self.stack.append(Name(str(module), str(name)))

    def reduce(self, _: object) -> None:
        called, arguments = self.take(2)
        if not isinstance(arguments, tuple):
            raise ValueError("it calls something with no arguments")
        self.stack.append(self.call(called, arguments))

    def give_state(self, _: object) -> None:
        state = self.pop()
        self.build(self.stack[-1], state)


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
    "GLOBAL": lambda names: Name(*names.split(" ", 1)),
}
_ACTIONS: dict[str, Callable[[PickleMachine, Any], Any]] = {
    "MARK": PickleMachine.mark,
    "POP": lambda m, _: m.marks.pop() if m.marks and m.marks[-1] == len(m.stack) else m.pop(),
    "POP_MARK": lambda m, _: m.above_mark(),
    "DUP": lambda m, _: m.stack.append(m.stack[-1]),
    **dict.fromkeys(("PUT", "BINPUT", "LONG_BINPUT"), PickleMachine.put),
    "MEMOIZE": lambda m, _: m.put(len(m.memo)),
    **dict.fromkeys(("GET", "BINGET", "LONG_BINGET"), PickleMachine.get),
    "TUPLE": lambda m, _: m.stack.append(tuple(m.above_mark())),
    "TUPLE1": lambda m, _: m.stack.append(m.take(1)),
    "TUPLE2": lambda m, _: m.stack.append(m.take(2)),
    "TUPLE3": lambda m, _: m.stack.append(m.take(3)),
    "LIST": lambda m, _: m.stack.append(m.above_mark()),
    "APPEND": lambda m, _: m.extend([m.pop()]),
    "APPENDS": lambda m, _: m.extend(m.above_mark()),
    "DICT": lambda m, _: m.stack.append(dict(pairs(m.above_mark()))),
    "SETITEM": lambda m, _: m.update(list(m.take(2))),
    "SETITEMS": lambda m, _: m.update(m.above_mark()),
    "STACK_GLOBAL": PickleMachine.stack_global,
    **dict.fromkeys(("REDUCE", "NEWOBJ"), PickleMachine.reduce),
    "BUILD": PickleMachine.give_state,
    "BINPERSID": lambda m, _: m.stack.append(m.persistent(m.pop())),
}


def pairs(items: list[Any]) -> list[tuple[str | int, Any]]:
    """Keys with their values."""
    if len(items) % 2 or not all(isinstance(key, str | int) for key in items[::2]):
        raise RefusedError("has a dict whose keys are no names")
    return list(zip(items[::2], items[1::2], strict=True))
