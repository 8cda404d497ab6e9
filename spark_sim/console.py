"""What the program says: results on stdout; notes, errors and progress on stderr."""

import json
import math
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence, Sized
from contextlib import contextmanager
from pathlib import Path
from time import monotonic
from typing import Any, TextIO, TypeVar

from spark.errors import OutputError

T = TypeVar("T")

PROGRAM = "spark-sim"
# All but tab and line feed, and what turns the direction of a line.
_CONTROL = r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]"
_COLOURS = r"(?!\x1b\[(?:0|1|2|31|32|33)m)"  # that a report's text has


def say(text: str) -> None:
    """A result, for people."""
    _line(text, sys.stdout, _COLOURS)


def emit_json(value: Mapping[str, Any]) -> None:
    """A result, for scripts: one object on one line, so that several make JSON lines."""
    try:
        text = json.dumps(value, ensure_ascii=False, allow_nan=False)
    except ValueError as error:
        raise OutputError(f"not told: the result holds a number that is none ({error})") from error
    _line(text, sys.stdout)


def notes(path: str | Path, notes: Sequence[str]) -> None:
    """What was assumed of a file."""
    if notes:
        note(f"{Path(path).name}: {'; '.join(notes)}")


def note(text: str) -> None:
    """What should be known."""
    _aside(f"{PROGRAM}: note: {text}")


def error(text: str) -> None:
    """What went wrong."""
    _aside(f"{PROGRAM}: error: {text}")


def _aside(text: str) -> None:
    """A line on stderr. A disk that is full of such lines does not end the work."""
    try:
        _line(text, sys.stderr)
    except BrokenPipeError:
        raise
    except OSError:
        pass


def _line(text: str, stream: TextIO, but: str = "") -> None:
    """One flushed line, so that stdout and stderr keep their order; above a bar where one is up.
    Control characters are written out: names of files and joints must not steer a terminal."""
    text = re.sub(but + _CONTROL, lambda found: f"\\u{ord(found[0]):04x}", text)
    if "tqdm" in sys.modules:
        sys.modules["tqdm"].tqdm.write(text, file=stream)
        stream.flush()
    else:
        print(text, file=stream, flush=True)


def columns(rows: Sequence[tuple[str, ...]]) -> list[str]:
    """Lines of a table, each column as wide as its widest cell."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  "
        + "  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]


def uses_color() -> bool:
    """Whether stdout is a terminal whose user did not turn colours off (no-color.org)."""
    wanted = not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"
    return wanted and sys.stdout.isatty()


def progress(
    items: Iterable[T], label: str, total: int | None = None, *, lines: bool = False
) -> Iterator[T]:
    """`items`, with a bar on stderr while they are worked through; where it is no terminal nothing,
    or a line every ten seconds."""
    if not sys.stderr.isatty():
        began, count = monotonic(), len(items) if isinstance(items, Sized) else total
        tell = _lines(count, 0, label) if lines and count else None
        for done, item in enumerate(items, 1):
            yield item
            if tell and monotonic() - began > _LINE_EVERY:  # short work needs no line
                tell(done, {})
        return
    from tqdm import tqdm

    # Short work needs no bar.
    yield from tqdm(items, label, total, leave=False, dynamic_ncols=True, delay=0.5)


_LINE_EVERY, _LINE_SHARE = 10.0, 0.01  # [s], and of the time so far, from line to line of a meter

Tell = Callable[..., None]
"""`tell(step, figures, share)`: how many are done, figures beside it, and how much of the work that
is, where steps are not alike."""


@contextmanager
def meter(total: int, done: int, label: str, *, lines: bool = False) -> Iterator[Tell]:
    """A bar for long work, with figures beside it and the time that is left; on other streams than
    terminals nothing, or a line at the first step and then every ten seconds, later more seldom."""
    if not sys.stderr.isatty():
        yield _lines(total, done, label) if lines else lambda *_: None
        return
    from tqdm import tqdm

    began = monotonic()
    with tqdm(total=total, initial=done, desc=label, dynamic_ncols=True) as bar:

        def tell(step: int, figures: Mapping[str, float], share: float | None = None) -> None:
            shown = [f"{name}={value:.3g}" for name, value in figures.items()]
            if share is not None:
                bar.bar_format = "{l_bar}{bar}| {n_fmt}/{total_fmt} [{elapsed}{postfix}]"
                if 0 < share < 1 and step < total:
                    shown.append(f"{duration(_left(began, share))} left")
            if shown:
                bar.set_postfix_str(", ".join(shown), refresh=False)
            bar.update(step - bar.n)

        yield tell


def _left(began: float, share: float) -> float:
    """Seconds that are left of work that began at this time and of which this share is done."""
    return (monotonic() - began) * (1 - share) / share


def _lines(total: int, done: int, label: str) -> Tell:
    """A meter that writes lines."""
    began, told = monotonic(), -math.inf
    known: dict[str, float] = {}

    def tell(step: int, figures: Mapping[str, float], share: float | None = None) -> None:
        nonlocal told
        known.update(figures)
        now = monotonic()
        if now - told < max(_LINE_EVERY, _LINE_SHARE * (now - began)) and step < total:
            return
        first, told = math.isinf(told), now
        shown = "".join(f", {name} {value:.3g}" for name, value in known.items())
        if share is None:
            share = (step - done) / (total - done)
        # The first step tells nothing of the others.
        if not first and 0 < share < 1 and step < total:
            shown += f", {duration(_left(began, share))} left"
        note(f"{label}: {step} of {total}{shown}")

    return tell


def duration(seconds: float) -> str:
    """A time as people say it."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
