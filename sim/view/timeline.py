"""The time of a replay: playing, seeking, stepping, and going from one finding to the next."""

from collections.abc import Sequence
from dataclasses import dataclass

SPEEDS = (0.1, 0.25, 0.5, 1.0, 1.5, 2.0, 4.0)
_SAME_MOMENT = 0.05  # [s]: a finding that began this long ago is the one that is being looked at


@dataclass(frozen=True)
class Event:
    """A finding in time: from `start` to `stop` [s], of which measure, and in a sentence."""

    start: float
    stop: float
    measure: str
    sentence: str


class Timeline:
    """Where a replay of `frames` frames, `frame_time` [s] apart, is.

    `time` [s] runs from 0 to `duration`. A `loop` starts again at the end; else it stops.
    """

    def __init__(self, frames: int, frame_time: float) -> None:
        self.frames, self.frame_time = frames, frame_time
        self.time = 0.0
        self.playing = True
        self.speed = 1.0
        self.loop = True

    @property
    def duration(self) -> float:
        """The time [s] of the last frame."""
        return (self.frames - 1) * self.frame_time

    @property
    def frame(self) -> int:
        """The frame that is shown: the last one that has begun."""
        return min(int(self.time / self.frame_time + 1e-6), self.frames - 1)

    def advance(self, seconds: float) -> None:
        """Let `seconds` of real time go by."""
        if not self.playing or self.frames == 1:
            return
        self.time += seconds * self.speed
        if self.time < self.duration + self.frame_time:  # the last frame lasts as long as others
            return
        if self.loop:
            self.time %= self.duration + self.frame_time
        else:
            self.time, self.playing = self.duration, False

    def toggle(self) -> None:
        """Play or pause; at the end of what does not loop, play from the start."""
        if not self.playing and not self.loop and self.time >= self.duration:
            self.time = 0.0
        self.playing = not self.playing

    def seek(self, time: float) -> None:
        """Go to a time [s], or to the nearest end."""
        self.time = min(max(time, 0.0), self.duration)

    def seek_share(self, share: float) -> None:
        """Go to a share of the duration."""
        self.seek(share * self.duration)

    def step(self, frames: int) -> None:
        """Pause, and go some frames on, or back."""
        self.playing = False
        self.seek((self.frame + frames) * self.frame_time)

    def change_speed(self, by: int) -> None:
        """Go some places along `SPEEDS`."""
        at = SPEEDS.index(self.speed) + by
        self.speed = SPEEDS[min(max(at, 0), len(SPEEDS) - 1)]

    def go_to(self, event: Event) -> None:
        """Pause where a finding begins."""
        self.playing = False
        self.seek(event.start)

    def next(self, events: Sequence[Event]) -> Event | None:
        """The first finding that begins later; after the last one, the first."""
        later = [e for e in events if e.start > self.time + 1e-6]
        return min(later or events, key=lambda e: e.start, default=None)

    def previous(self, events: Sequence[Event]) -> Event | None:
        """The last finding that began earlier; before the first one, the last."""
        earlier = [e for e in events if e.start < self.time - _SAME_MOMENT]
        return max(earlier or events, key=lambda e: e.start, default=None)

    def current(self, events: Sequence[Event]) -> list[Event]:
        """The findings that last at this time, in their order."""
        return [e for e in events if e.start - 1e-6 <= self.time <= e.stop + 1e-6]
