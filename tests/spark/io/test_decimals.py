"""Numbers read eight digits at a time are those that Python reads, or left to another reader."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spark.io.decimals import parse_decimals

digits = st.text("0123456789", max_size=8)
words = st.builds(
    lambda minus, whole, part: f"{'-' * minus}{whole}.{part}",
    st.booleans(),
    digits,
    digits,
).filter(lambda word: 1 <= sum(map(str.isdigit, word)) <= 15)
blanks = st.text(" \t\r\n", min_size=1, max_size=3)


def _parsed(text: str) -> np.ndarray | None:
    letters = np.frombuffer(text.encode("latin-1"), np.uint8)
    edges = np.flatnonzero(np.diff(letters > 32, prepend=False, append=False))
    return parse_decimals(text.encode("latin-1"), edges[::2], edges[1::2])


@given(st.lists(st.tuples(words, blanks), min_size=1), blanks)
def test_as_python_reads_them(table: list[tuple[str, str]], before: str) -> None:
    found = _parsed(before + "".join(word + blank for word, blank in table))
    expected = np.array([float(word) for word, _ in table])
    assert found is not None
    assert found.tobytes() == expected.tobytes()  # -0.0 is not 0.0


@pytest.mark.parametrize(
    "word",
    [
        *("1", "-", ".", "-.", "1.2.3", "1-.2", "--1.2", "1.2-", "+1.0", "1.0e3", "1.0E3"),
        *("x.5", "1.5\x00", "\x1f1.5", "1/5", "1:2.5", "\xe91.5"),
        *("123456789.0", "0.123456789", "12345678.12345678"),
    ],
)
def test_others_are_left(word: str) -> None:
    assert _parsed(f"1.5 {word} 2.25\n") is None


def test_nothing() -> None:
    assert _parsed(" \n") is None
