"""When the robot takes its steps."""

import time

from spark.errors import ConventionError
from spark.motion import check_frame_time

_LATE = 1.0  # [s]: after a pause this long the machine slept, and steps are not made up for
_LEAD = 0.002  # [s] from a pose to the step that takes it
_PULL = 0.01  # of a step, the most by which it is shifted


def frame_time_of(fps: float) -> float:
    """The time between steps [s], so many a second. Raises `ConventionError` where there are none
    such."""
    if isinstance(fps, str | bool) or not hasattr(fps, "__float__") or not fps > 0:
        raise ConventionError(f"fps is {fps!r}; expected a positive number, such as 60")
    check_frame_time(1.0 / fps)
    return 1.0 / fps


class Pace:
    """Steps every `frame_time` [s]. One that is over before it could be taken is left out.

    `step` counts the steps, also those that were left out, `missed` these alone.
    """

    def __init__(self, frame_time: float) -> None:
        self.frame_time = frame_time
        self.step, self.missed = 0, 0
        self.restart()

    def restart(self) -> None:
        """Take the next step now."""
        self._due = time.monotonic()

    @property
    def due(self) -> float:
        """When the next step is due [s, `time.monotonic`]."""
        return self._due

    @property
    def left(self) -> float:
        """How long it is until the next step [s]."""
        return max(self._due - time.monotonic(), 0.0)

    def advance(self) -> None:
        """A step was taken: wait for the next one."""
        self.step += 1
        self._due += self.frame_time
        behind = time.monotonic() - self._due
        if behind > _LATE:
            self.restart()
        elif behind > self.frame_time:
            over = int(behind / self.frame_time)
            self.step += over
            self.missed += over
            self._due += over * self.frame_time

    def follow(self, age: float) -> None:
        """Move the steps towards the moments when poses come, so that a pose of `age` [s] would be
        `_LEAD` old: no faster than a clock may be off."""
        if age > self.frame_time:  # it waited while a step took too long
            return
        most = _PULL * self.frame_time
        self._due -= min(max(0.1 * (age - _LEAD), -most), most)
