"""The rows of numbers of a BVH file: fast where they are right, mended where that is without doubt,
and with the line of the fault where they are wrong.
"""

from collections.abc import Iterator
from typing import NoReturn

import numpy as np
import orjson
from jaxtyping import Float, Int, UInt8

from spark.errors import FileFormatError
from spark.io.decimals import parse_decimals
from spark.io.scanner import LARGEST, Scanner, number, shown
from spark.summary import counted

_MIN_FRAME_TIME = 1e-9  # [s] a shorter one is a broken file

# Of the rows that `Frames:` promises: with fewer the file was cut, and what it shows is not what
# was recorded.
_LEAST_SHARE = 0.5


def parse_motion(
    scanner: Scanner, channels: int, given: float | None = None
) -> tuple[float, Float[np.ndarray, "T C"], tuple[str, ...]]:
    """The frame time [s] and the rows, from the keyword MOTION on, and notes on what was mended.

    Rows of `channels` values each that are not as many as `Frames:` says are taken as they are,
    down to half of them. A frame time that is `given` replaces the file's. Raises
    `FileFormatError` with the line for anything else.
    """
    word = scanner.word()
    if word.lower() == b"root":
        scanner.fail("a second ROOT; expected one skeleton a file: split it")
    if not word:
        scanner.fail(
            "expected MOTION, found the end of the file; a rig without motion ends with the lines "
            "MOTION, Frames: 0, Frame Time: 0.04"
        )
    if word.lower() != b"motion":
        scanner.fail(f"expected MOTION, found {shown(word)}")
    if channels == 0:
        scanner.fail("no joint has CHANNELS, so nothing can move; expected at least one")
    scanner.expect_label("Frames")
    frames = scanner.count("Frames")
    scanner.expect_label("Frame", "Time")
    frame_time = scanner.number("Frame Time")
    notes: tuple[str, ...] = ()
    if given is not None:
        frame_time = given
    elif frame_time < _MIN_FRAME_TIME and frames > 1:
        scanner.fail(
            f"Frame Time is {frame_time:g}; expected seconds a frame, such as 0.0333333; or give "
            "--fps"
        )
    elif frame_time < _MIN_FRAME_TIME:
        notes = (f"Frame Time is {frame_time:g}; a single frame needs none: read as 1/30 s",)
        frame_time = 1 / 30
    text, start = scanner.data, scanner.end
    values = _parse_rows(text, start, frames, channels)
    if values is not None:
        return frame_time, values, notes
    lines = sum(
        not line.isspace()
        for at, stop in _blocks(text, start)
        for line in text[at:stop].splitlines()
        if line
    )
    if lines >= max(1, _LEAST_SHARE * frames):
        values = _parse_rows(text, start, lines, channels)
    if values is None:
        _diagnose(scanner, frames, channels)
    note = f"Frames: says {frames}, but {counted(lines, 'row')} of values follow: those are read"
    return frame_time, values, (*notes, note)


# Bytes that a table of numbers may hold; those up to the space stand between them.
_NUMERIC = b"0123456789+-.eE \t\r\n\v\f"

_BLOCK = 1 << 18  # bytes of text that are read at a time: arrays of their words fit in a cache


def _parse_rows(
    text: bytes, start: int, frames: int, channels: int
) -> Float[np.ndarray, "T C"] | None:
    """The values from `start` on, or None where they are not `frames` rows of finite numbers."""
    count = frames * channels
    if 2 * count > len(text) - start + 1:
        return None  # so many do not fit in the text
    values = np.empty(count)
    widths: list[Int[np.ndarray, L]] = []
    done = 0
    for at, stop in _blocks(text, start):
        block = text[at:stop]
        letters = np.frombuffer(block, dtype=np.uint8)
        edges = np.flatnonzero(np.diff(letters > ord(" "), prepend=False, append=False))
        starts, stops = edges[::2], edges[1::2]
        ends = np.flatnonzero((letters == 10) | (letters == 13))
        widths.append(np.diff(np.searchsorted(starts, ends), prepend=0, append=len(starts)))
        numbers = parse_decimals(block, starts, stops)
        if numbers is None:
            numbers = _numbers(block, letters, starts)
        if numbers is None or done + len(numbers) > count:
            return None
        values[done : done + len(numbers)] = numbers
        done += len(numbers)
    per_line = np.concatenate([np.zeros(0, int), *widths])
    per_line = per_line[per_line > 0]
    if done != count or (len(per_line) == frames and np.any(per_line != channels)):
        return None  # also one value too many here and one too few there: not wrapped rows
    return values.reshape(frames, channels)


def _blocks(text: bytes, start: int) -> Iterator[tuple[int, int]]:
    """Where the parts of a text begin and end, each of whole lines."""
    while start < len(text):
        end = text.find(b"\n", start + _BLOCK) + 1 or len(text)
        yield start, end
        start = end


def _numbers(
    block: bytes, letters: UInt8[np.ndarray, "B"], starts: Int[np.ndarray, "W"]
) -> Float[np.ndarray, "W"] | None:
    """The numbers of a text whose words begin at `starts`; None where a word is no finite one."""
    if not len(starts):
        return np.zeros(0)
    if block.translate(None, _NUMERIC):
        return None
    try:
        # A JSON reader is three times as fast as numpy's, but takes no "+1", ".5" or "01".
        listed = letters.copy()
        listed[starts[1:] - 1] = ord(",")
        values = np.fromiter(orjson.loads(b"[" + listed.tobytes() + b"]"), np.float64, len(starts))
    except (orjson.JSONDecodeError, OverflowError):
        try:
            values = np.fromstring(block, sep=" ")
        except (ValueError, DeprecationWarning):
            return None
    # Older numpy stops at a word that is no number, with a warning alone.
    if len(values) != len(starts) or not np.all(np.abs(values) <= LARGEST):
        return None
    return values


def _diagnose(scanner: Scanner, frames: int, channels: int) -> NoReturn:
    """Say why `_parse_rows` gave up: a slow second pass over the text."""
    found, lines, end = 0, 0, None
    odd: list[tuple[int, int]] = []
    for line, words in scanner.lines():
        for word in words:
            if number(word) is None:
                raise FileFormatError(
                    scanner.path,
                    line,
                    f"expected a finite number, at most 1e12, found {shown(word)}",
                )
        if words:
            found, lines, end = found + len(words), lines + 1, line
        if words and len(words) != channels:
            odd.append((line, len(words)))
    needed = frames * channels
    if found == needed:
        at, width = odd[0]
        raise FileFormatError(
            scanner.path, at, f"{width} values in this row; expected {channels}, one a channel"
        )
    fault = "cut short" if found < needed else "too long"
    remedy = (
        f"; set Frames: {found // channels} to use it"
        if found % channels == 0
        else f" ({found // channels} whole frames); fetch or export the file again"
    )
    # A few odd rows are the fault; many are rows wrapped over lines.
    raise FileFormatError(
        scanner.path,
        odd[0][0] if 0 < len(odd) < max(2, lines // 2) else end,
        f"the motion is {fault}: Frames: {frames} with {channels} channels each need {needed} "
        f"values, not {found}{remedy}",
    )
