"""Good files spoilt: bytes changed at random, and numbers that no one meant."""

import io
import re
import zipfile
from random import Random

from hypothesis import strategies as st

from tests.helpers.hostile import damaged, edits, place_in

_NUMBER = re.compile(rb"-?\d+\.?\d*(?:e[+-]?\d+)?")
_ODD = (
    *("0", "-1", "1", "2", "nan", "inf", "-inf", "1e-300", "1e30", "1e308", "-1e12", "1e12"),
    *("99999999999", "65536", "3600", "0.0000001"),
)

numbers = st.lists(
    st.tuples(st.integers(0, 1 << 20), st.sampled_from(_ODD)), min_size=0, max_size=4
)
"""After which places of a file the next number becomes which."""


def spoilt(
    data: bytes, values: list[tuple[int, str]], changes: list[tuple[str, int, int]]
) -> bytes:
    """The file with numbers replaced, then bytes as `damaged` changes them."""
    for place, value in values:
        at = place_in(data, place) if data else 0
        number = _NUMBER.search(data, max(at, 0)) or _NUMBER.search(data)
        if number:
            data = data[: number.start()] + value.encode() + data[number.end() :]
    return damaged(data, changes)


changes: st.SearchStrategy[list[tuple[str, int, int]]] = st.just([]) | edits
"""None where numbers alone are spoilt: the file is still one of its format."""


def by_chance(data: bytes, random: Random) -> bytes:
    """The file spoilt as `spoilt` does it, by chance alone: ten times as fast as hypothesis. Of
    every second archive the members are spoilt, whose checksums would else tell of any change."""
    if data.startswith(b"PK") and random.random() < 0.5:
        return _with_members(data, random)
    values = [(random.randrange(1 << 20), random.choice(_ODD)) for _ in range(random.randrange(5))]
    edits = [
        (random.choice("xdic"), random.randrange(1 << 20), random.randrange(256))
        for _ in range(random.choice((0, 0, 1, 2, 4)))
    ]
    return spoilt(data, values, edits)


def _with_members(data: bytes, random: Random) -> bytes:
    out = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as old, zipfile.ZipFile(out, "w") as new:
        names = old.namelist()
        chosen = random.choice(names)
        for name in names:
            member = old.read(name)
            new.writestr(name, by_chance(member, random) if name == chosen else member)
    return out.getvalue()
