"""When a sender made its poses: more even than the moments at which they arrive."""

from collections import deque

import numpy as np

_TOGETHER = 0.002  # [s]: packets that come this close, and are not told apart, are one pose
_COUNTED = 64  # arrivals that tell the sender's interval
_COMPARED = 256  # arrivals by which the sender's clock is judged
_OFF, _DELAYED = 0.1, 0.1  # of what has passed, and [s]: a clock that is off by more errs
_LOW = 40.0  # percentile of the intervals: of poses that are not lost, and not biased by jitter
_REFINED = 4  # times
_PULL = 0.02  # of how far an arrival is from where it is expected: delays vary, clocks drift
_ANEW = 0.25  # [s]: a pose that is further from there than this tells of another clock
_PAUSE = 0.5  # [s]: no interval, but a sender that was silent


class SenderClock:
    """Dates poses on our clock [s]. What has passed since the last pose is told by the sender's own
    time; where there is none, or it stands still, by how many of its mean intervals fit best.

    Delays on the way are evened out: dates follow the arrivals at a fiftieth of what they are off.
    """

    def __init__(self) -> None:
        self._intervals: deque[float] = deque(maxlen=_COUNTED)
        self._stamps: deque[tuple[float, float]] = deque(maxlen=_COMPARED)
        self._arrived = self._time = -np.inf

    def date(self, arrived: float, stamp: float | None) -> float:
        """When a pose was made that arrived at a time, with the sender's time in it. The same as
        of the pose before where it is a further packet of that one."""
        passed, interval = self._told(arrived, stamp), arrived - self._arrived
        if np.isinf(interval):
            self._arrived = self._time = arrived
            return arrived
        if passed is None and interval < _TOGETHER:
            return self._time
        if interval < _PAUSE:
            self._intervals.append(interval)
        if passed is None:
            passed = self._whole(arrived - self._time)
        expected = self._time + passed
        anew = not abs(arrived - expected) < _ANEW
        self._time = arrived if anew else expected + _PULL * (arrived - expected)
        self._arrived = arrived
        return self._time

    def _told(self, arrived: float, stamp: float | None) -> float | None:
        """What has passed by the sender's clock, where it goes as ours does."""
        last = self._stamps[-1][1] if self._stamps else None
        if stamp is None or stamp == last:
            return None
        if last is None or stamp < last:
            self._stamps.clear()
        self._stamps.append((arrived, stamp))
        ours, theirs = (
            new - old for new, old in zip((arrived, stamp), self._stamps[0], strict=True)
        )
        if last is None or len(self._stamps) == 1 or abs(theirs - ours) > _OFF * ours + _DELAYED:
            return None
        return stamp - last

    def _whole(self, passed: float) -> float:
        """The whole number of intervals, one at least, that is nearest to what has passed."""
        if not self._intervals:
            return passed
        intervals = np.array(self._intervals)
        each = np.percentile(intervals, _LOW)
        for _ in range(_REFINED):  # where none is taken for two, it is the mean
            each = intervals.sum() / max(np.rint(intervals / each).sum(), 1.0)
        return float(max(round(passed / each), 1) * each)

    @property
    def rate(self) -> float:
        """How many poses a second arrive."""
        return len(self._intervals) / sum(self._intervals) if self._intervals else 0.0
