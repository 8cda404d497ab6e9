"""The rows of numbers of a BVH file: fast where they are right, mended where that is without doubt,
and with the line of the fault where they are wrong.
"""

from typing import NoReturn

import numpy as np
import orjson
from jaxtyping import Float

from spark.errors import FileFormatError
from spark.io.scanner import LARGEST, Scanner, number, shown
from spark.summary import counted

_MIN_FRAME_TIME = 1e-9  # [s] a shorter one is a broken file

# Of the rows that `Frames:` promises: with fewer the file was cut, and what it shows is not what
# was recorded.
_LEAST_SHARE = 0.5


def parse_motion(
    scanner: Scanner, channels: int
) -> tuple[float, Float[np.ndarray, "T C"], tuple[str, ...]]:
    """The frame time [s] and the rows, from the keyword MOTION on, and notes on what was mended.

    Rows of `channels` values each that are not as many as `Frames:` says are taken as they are,
    down to half of them. Raises `FileFormatError` with the line for anything else.
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
    if frame_time < _MIN_FRAME_TIME:
        scanner.fail(f"Frame Time is {frame_time:g}; expected seconds a frame, such as 0.0333333")
    rows = scanner.data[scanner.end :]
    values = _parse_rows(rows, frames, channels)
    if values is not None:
        return frame_time, values, ()
    lines = sum(not line.isspace() for line in rows.splitlines() if line)
    if lines >= max(1, _LEAST_SHARE * frames):
        values = _parse_rows(rows, lines, channels)
    if values is None:
        _diagnose(scanner, frames, channels)
    note = f"Frames: says {frames}, but {counted(lines, 'row')} of values follow: those are read"
    return frame_time, values, (note,)


# Bytes that a table of numbers may hold.
_NUMERIC = np.isin(np.arange(256), np.frombuffer(b"0123456789+-.eE \t\r\n\v\f", dtype=np.uint8))


def _parse_rows(rows: bytes, frames: int, channels: int) -> Float[np.ndarray, "T C"] | None:
    """The values, or None where they are not `frames` rows of finite numbers."""
    letters = np.frombuffer(rows, dtype=np.uint8)
    blank = (letters == 32) | ((letters >= 9) & (letters <= 13))
    first = ~blank
    first[1:] &= blank[:-1]
    starts = np.flatnonzero(first)
    if len(starts) != frames * channels:
        return None
    breaks = np.flatnonzero((letters == 10) | (letters == 13))
    per_line = np.diff(np.searchsorted(starts, breaks), prepend=0, append=len(starts))
    per_line = per_line[per_line > 0]
    if len(per_line) == frames and np.any(per_line != channels):
        return None  # one value too many here and one too few there, not wrapped rows
    if frames == 0:
        return np.zeros((0, channels))
    if not _NUMERIC[letters].all():
        return None
    try:
        # A JSON reader is three times as fast as numpy's, but takes no "+1", ".5" or "01".
        listed = letters.copy()
        listed[starts[1:] - 1] = ord(",")
        values = np.array(orjson.loads(b"[" + listed.tobytes() + b"]"), dtype=np.float64)
    except orjson.JSONDecodeError:
        try:
            values = np.fromstring(rows, sep=" ")
        except (ValueError, DeprecationWarning):
            return None
    # Older numpy stops at a word that is no number, with a warning alone.
    if len(values) != len(starts) or not np.all(np.abs(values) <= LARGEST):
        return None
    return values.reshape(frames, channels)


def _diagnose(scanner: Scanner, frames: int, channels: int) -> NoReturn:
    """Say why `_parse_rows` gave up: a slow second pass over the text."""
    rows = [(at, words) for at, words in scanner.lines() if words]
    for line, words in rows:
        for word in words:
            if number(word) is None:
                raise FileFormatError(
                    scanner.path,
                    line,
                    f"expected a finite number, at most 1e12, found {shown(word)}",
                )
    found, needed = sum(len(words) for _, words in rows), frames * channels
    odd = [(at, len(words)) for at, words in rows if len(words) != channels]
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
    end = rows[-1][0] if rows else None
    raise FileFormatError(
        scanner.path,
        odd[0][0] if 0 < len(odd) < max(2, len(rows) // 2) else end,
        f"the motion is {fault}: Frames: {frames} with {channels} channels each need {needed} "
        f"values, not {found}{remedy}",
    )
