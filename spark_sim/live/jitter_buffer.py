"""Poses that arrive at any rate, with jitter and losses, made into one a step."""

from collections import deque
from dataclasses import dataclass
from math import exp, isinf

import numpy as np

from robots.stream.frame_targets import Frame
from spark.rotation import quat_slerp
from spark_sim.live.sender_clock import SenderClock

_GAPS = 128  # between poses, that tell the delay
_BRIDGED = 98.0  # percentile of the gaps: an outlier shall not delay all poses
_LONGEST = 0.25  # [s]: who waits longer for a pose waits for a sender that stalls
_CATCH_UP = 6.0  # [1/s], critically damped: half a second to another delay
_RETURN = 0.5  # [s] from the pose that was held in a stall to the sender's
_KEPT = 512  # poses, more than come within a stall
_HIGHER = 3.0  # [m] than another pose is nobody's: the sender's unit is another one


@dataclass(frozen=True, eq=False)
class _Pose:
    time: float  # [s]
    frame: Frame


class JitterBuffer:
    """Plays a sender's poses out steadily, delayed by as much as they need to be there in time.

    The delay is how old the newest pose becomes before the next one comes: nearly nothing where
    poses come as often as steps are taken, about an interval of the sender where they come less
    often, and more where some are lost. Where none comes for longer, the pose is held. The playhead
    follows another delay smoothly: for a while poses are played a little faster or slower than they
    were made. From a stall it takes half a second to where the sender is by then.
    """

    def __init__(self) -> None:
        self._clock = SenderClock()
        self._poses: deque[_Pose] = deque(maxlen=_KEPT)
        self._gaps: deque[float] = deque(maxlen=_GAPS)
        self._fresh: deque[float] = deque(maxlen=_GAPS)
        self._age, self._is_fresh = 0.0, False
        self._now = self._playhead = -np.inf
        self._speed = 1.0
        self._played: Frame | None = None
        self._held: Frame | None = None
        self._since = 0.0

    def put(self, frame: Frame, arrived: float, stamp: float | None) -> None:
        """Take a pose that arrived at a time [s]. `stamp` is when it was made by the sender's
        clock [s], if that is known."""
        time = self._clock.date(arrived, stamp)
        if self._poses and time < self._poses[-1].time - _LONGEST:  # our clock was set back
            self._poses.clear()
            self._now = -np.inf
        if self._poses and time <= self._poses[-1].time:  # more of the same pose
            self._poses[-1] = _Pose(self._poses[-1].time, frame)
            return
        if self._poses and time > self._poses[-1].time + _LONGEST:
            self._held, self._now = self._played, -np.inf
        self._poses.append(_Pose(time, frame))
        self._is_fresh = True

    def get(self, now: float) -> Frame:
        """The pose of the step that is due at a time [s], of which one came at least."""
        self._measure(now)
        self._move_on(now)
        self._played = self._returning(self._at(self._playhead), now)
        return self._played

    def _returning(self, frame: Frame, now: float) -> Frame:
        """The pose on the way back from a stall."""
        share = (now - self._since) / _RETURN
        if self._held is None or share >= 1:
            self._held = None
            return frame
        return _between(self._held, frame, share * share * (3 - 2 * share))

    def _measure(self, now: float) -> None:
        """How old the newest pose is when it is used first, and became before another one came."""
        age = now - self._poses[-1].time
        if self._is_fresh:
            if not isinf(self._now) and self._age < _LONGEST:
                self._gaps.append(self._age)
            self._fresh.append(age)
        self._age, self._is_fresh = age, False

    def _move_on(self, now: float) -> None:
        """Move the playhead as a critically damped spring would that pulls it to the delay."""
        delay, before, newest = self.delay, self._playhead, self._poses[-1].time
        passed = max(now - self._now, 0.0)
        if isinf(passed):
            self._playhead, self._speed = min(now - delay, newest), 1.0
            self._since = now
        else:
            lag, slow = self._now - delay - before, 1.0 - self._speed
            pull, decay = slow + _CATCH_UP * lag, exp(-_CATCH_UP * passed)
            wanted = now - delay - (lag + pull * passed) * decay
            self._speed = 1.0 - (slow - _CATCH_UP * pull * passed) * decay
            self._playhead = max(min(wanted, newest), before)
            if wanted > newest and passed:
                self._speed = (self._playhead - before) / passed
        self._now = now

    @property
    def delay(self) -> float:
        """How long after its arrival a pose is played [s]."""
        return float(np.percentile(self._gaps, _BRIDGED)) if self._gaps else self._age

    @property
    def wait(self) -> float:
        """By how much a pose is played later than by the step that could use it first [s]."""
        return max(self.delay - float(np.median(self._fresh)), 0.0) if self._fresh else 0.0

    @property
    def rate(self) -> float:
        """How many poses a second arrive."""
        return self._clock.rate

    def _at(self, time: float) -> Frame:
        """The pose at a time [s], between the two beside it."""
        poses = self._poses
        while len(poses) > 2 and poses[1].time <= time:  # what is played is over
            poses.popleft()
        if len(poses) == 1 or time <= poses[0].time:
            return poses[0].frame
        (start, a), (end, b) = ((pose.time, pose.frame) for pose in (poses[0], poses[1]))
        return _between(a, b, min((time - start) / (end - start), 1.0))


def _between(a: Frame, b: Frame, share: float) -> Frame:
    """The pose on the way from one to another; the first, where there is no way."""
    if abs(b.root_pos[2] - a.root_pos[2]) > _HIGHER:
        return a
    places = None
    if a.translations is not None and b.translations is not None:
        places = a.translations + share * (b.translations - a.translations)
    return Frame(
        a.root_pos + share * (b.root_pos - a.root_pos),
        quat_slerp(a.rotations, b.rotations, np.full(len(a.rotations), share)),
        places,
    )
