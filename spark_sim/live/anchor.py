"""Where a person would be whom nothing had put elsewhere."""

from collections.abc import Callable

import numpy as np

from robots.stream.frame_targets import Frame
from robots.stream.jump_filter import FASTEST, UNSEEN
from spark_sim.live.listener import Arrival


class Anchor:
    """Takes jumps over the ground out of a sender's poses, and notes them. Steps are `frame_time`
    [s] apart."""

    def __init__(self, frame_time: float, note: Callable[[str], None]) -> None:
        self._frame_time, self._note = frame_time, note
        self._last: Arrival | None = None
        self._moved = np.zeros(2)

    def hold(self, arrival: Arrival) -> Frame:
        """The pose, so that it goes on where the one before was."""
        last, self._last = self._last, arrival
        if last is not None:
            jump = arrival.frame.root_pos[:2] - last.frame.root_pos[:2]
            far = float(np.hypot(*jump))
            passed = max(min(arrival.came - last.came, UNSEEN), self._frame_time)
            if far > FASTEST * passed:
                self._note(f"the sender jumped by {far:.2f} m: the robot goes on where it is")
                self._moved -= jump
        place = arrival.frame.root_pos.copy()
        place[:2] += self._moved
        return arrival.frame._replace(root_pos=place)
