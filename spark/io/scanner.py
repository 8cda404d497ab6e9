"""The words of a text file, one after the other, with the line that each is on."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NoReturn

import numpy as np

from spark.errors import FileFormatError

_WORD = re.compile(rb"\s*([{}]|[^\s{}]*)")
_LABEL = re.compile(rb"[^\S\r\n]*([^\r\n{}]*)")
_LINE_END = re.compile(rb"\r\n|\r|\n")
_NUMBER_AHEAD = re.compile(rb"\s*[-+.]?\d")
_NUMBER = re.compile(rb"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")

# Squares and sums of numbers up to here stay finite; no length or angle is larger.
LARGEST = 1e12


def number(word: bytes) -> float | None:
    """The number that `word` spells out; None for other words, for nan, and beyond `LARGEST`."""
    value = float(word) if _NUMBER.fullmatch(word) else np.inf
    return value if abs(value) <= LARGEST else None


def shown(word: bytes) -> str:
    """The word as an error message shows it."""
    return repr(word[:20].decode(errors="backslashreplace")) if word else "the end of the file"


class Scanner:
    """Walks over the words of a file; a brace is a word of its own. Errors name file and line."""

    def __init__(self, path: Path, data: bytes) -> None:
        self.path, self.data = path, data
        self.start = self.end = 3 if data.startswith(b"\xef\xbb\xbf") else 0

    def word(self) -> bytes:
        """The next word; empty at the end of the file."""
        return self._take(_WORD)

    def label(self) -> bytes:
        """The rest of the line, up to a brace."""
        return self._take(_LABEL).strip()

    def expect(self, keyword: str) -> None:
        """Take the next word, which must be `keyword` in any case."""
        word = self.word()
        if word.lower() != keyword.lower().encode():
            self.fail(f"expected {keyword}, found {shown(word)}")

    def expect_label(self, *keywords: str) -> None:
        """Take a label such as "Frame Time:", with or without spaces and colon, in any case."""
        pattern = rb"\s*" + rb"[ \t]*".join(word.encode() for word in keywords) + rb"[ \t]*:?"
        found = re.compile(pattern, re.IGNORECASE).match(self.data, self.end)
        if not found:
            self.fail(f"expected {' '.join(keywords)}:, found {shown(self.word())}")
        self.end = found.end()

    def number(self, what: str) -> float:
        """The next word as a number."""
        word = self.word()
        value = number(word)
        if value is None:
            self.fail(f"expected a number for {what}, at most 1e12, found {shown(word)}")
        return value

    def at_number(self) -> bool:
        """Whether the next word begins like a number."""
        return bool(_NUMBER_AHEAD.match(self.data, self.end))

    def count(self, what: str) -> int:
        """The next word as a whole number, not negative; it may be written as 150.0."""
        word = self.word()
        found = re.fullmatch(rb"(\d{1,15})(?:\.0*)?", word)
        if not found:
            self.fail(f"expected a whole number for {what}, found {shown(word)}")
        return int(found[1])

    def lines(self) -> Iterator[tuple[int, list[bytes]]]:
        """What follows, line by line: the line's number and its words."""
        at, number = self.end, self._line(self.end)
        for found in _LINE_END.finditer(self.data, self.end):
            yield number, self.data[at : found.start()].split()
            at, number = found.end(), number + 1
        yield number, self.data[at:].split()

    def fail(self, message: str) -> NoReturn:
        """Raise `FileFormatError` at the word that was taken last."""
        raise FileFormatError(self.path, self._line(self.start), message)

    def _take(self, pattern: re.Pattern[bytes]) -> bytes:
        found = pattern.match(self.data, self.end)
        assert found
        self.start, self.end = found.span(1)
        return found[1]

    def _line(self, position: int) -> int:
        return len(_LINE_END.findall(self.data, 0, position)) + 1
