"""The bar under a replay: when each flag is up, over time, and what a click on it means.

Places are in pixels of the picture, from its lower left corner.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool

from sim.view.annotations import Annotations
from sim.view.timeline import Event, Timeline
from spark.runs import true_runs

_NEAR = 6  # pixels: a click that is this far from a finding means it


@dataclass(frozen=True)
class Rect:
    """A part of the picture."""

    left: float
    bottom: float
    width: float
    height: float

    def holds(self, x: float, y: float) -> bool:
        """Whether a place is in it."""
        return (
            self.left <= x <= self.left + self.width
            and self.bottom <= y <= self.bottom + self.height
        )


class Bar:
    """Rows of flags over the strip of time, in a picture `width` pixels wide; `line` is the height
    of a line of text. Only measures with a flag that is up somewhere have a row."""

    def __init__(
        self, timeline: Timeline, known: Annotations | None, width: int, line: int
    ) -> None:
        self._timeline, self._known = timeline, known
        self.line = line
        self.rows = () if known is None else tuple(n for n, up in known.flags.items() if up.any())
        self.height = int(line * (2.9 + 1.15 * len(self.rows)))
        gutter = 10.5 * line if self.rows else 1.0 * line
        self.strip = Rect(gutter, 1.65 * line, max(width - gutter - line, 1.0), 0.55 * line)
        self.area = Rect(0.0, 0.0, float(width), float(self.height))

    def row(self, name: str) -> Rect:
        """Where a flag's row is."""
        at = self.rows[::-1].index(name)
        bottom = self.strip.bottom + self.line * (0.9 + 1.15 * at)
        return Rect(self.strip.left, bottom, self.strip.width, 0.75 * self.line)

    def x_of(self, time: float) -> float:
        """Where a time [s] is, from the left."""
        return self.strip.left + self.strip.width * time / max(self._length, 1e-9)

    def shades(self, name: str) -> Iterator[Rect]:
        """Where a flag is up."""
        assert self._known is not None
        row, step = self.row(name), self._known.frame_time
        up: Bool[np.ndarray, T] = self._known.flags[name]
        for start, stop in true_runs(up):
            left, right = self.x_of(start * step), self.x_of(stop * step)
            yield Rect(left, row.bottom, max(right - left, 2.0), row.height)

    def click(self, x: float, y: float) -> Event | float | None:
        """The finding that is meant by a click, or the time [s], or None outside.

        On the row of a flag, a finding of its measure that is there or near; beside all of them,
        and on the strip below, the time.
        """
        if not self.area.holds(x, y) or x < self.strip.left - self.line:
            return None
        time = self._time(x)
        for name in self.rows:
            if self.row(name).holds(x, y):
                near = _NEAR * self._length / self.strip.width
                events = [e for e in self._events(name) if e.start - near <= time <= e.stop + near]
                return min(events, key=lambda e: abs(e.start - time), default=time)
        return time

    def drag(self, x: float) -> float:
        """The time [s] that a held mouse button seeks."""
        return self._time(x)

    def _events(self, name: str) -> list[Event]:
        assert self._known is not None
        return [event for event in self._known.events if event.measure == name]

    def _time(self, x: float) -> float:
        share = (x - self.strip.left) / self.strip.width
        return min(max(share, 0.0), 1.0) * self._length

    @property
    def _length(self) -> float:
        """What the strip's width stands for [s]: the last frame lasts as long as the others."""
        return self._timeline.duration + self._timeline.frame_time
