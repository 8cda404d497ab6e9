"""Files that would run a program if they were unpickled, and files with bytes changed at random."""

import os
from pathlib import Path
from typing import Any

from hypothesis import strategies as st


class Bomb:
    """Unpickled, it makes the folder `mark`."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple[Any, ...]:
        return os.mkdir, (str(self.mark),)


edits = st.lists(
    st.tuples(st.sampled_from("xdic"), st.integers(0, 1 << 20), st.integers(0, 255)),
    min_size=1,
    max_size=6,
)
"""Changes for `damaged`: what to do, where, and with which byte."""


def damaged(data: bytes, changes: list[tuple[str, int, int]]) -> bytes:
    """The bytes with some replaced, deleted or put in, or cut off at the end."""
    out = bytearray(data)
    for kind, place, byte in changes:
        if not out:
            break
        at = place_in(out, place)
        if kind == "x":
            out[at] = byte
        elif kind == "d":
            del out[at : at + 1 + byte % 4]
        elif kind == "i":
            out.insert(at, byte)
        else:
            del out[len(out) - place % min(len(out), 4000) :]
    return bytes(out)


def place_in(data: bytes | bytearray, place: int) -> int:
    """An index of the bytes. Most files say what they are at their beginning and end, so half of
    the places are there."""
    if place % 2:
        near = place % min(len(data), 300)
        return near if place % 4 == 1 else len(data) - 1 - near
    return place % len(data)
