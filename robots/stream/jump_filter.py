"""Where a source would be that nothing had put elsewhere: a person who left the cameras' view and
comes back on the other side, a game's character that is moved. No robot can follow that; it goes on
where it is."""

import numpy as np

from robots.stream.frame_targets import Frame

FASTEST = 12.0  # [m/s]: who is faster was put somewhere else
UNSEEN = 0.05  # [s] that one may go on so fast between two frames: some may be lost


class JumpFilter:
    """Takes jumps over the ground out of frames that are `frame_time` [s] apart."""

    def __init__(self, frame_time: float) -> None:
        self._farthest = FASTEST * max(frame_time, UNSEEN)
        self.reset()

    def reset(self) -> None:
        """Forget what has been seen."""
        self._last = self._moved = np.zeros(3)

    def hold(self, frame: Frame) -> Frame:
        """The frame after that which was taken last, so that it goes on where that was; one that
        has no place as it is."""
        root = frame.root_pos
        if np.shape(root) != (3,) or not np.isfinite(root).all():
            return frame
        x, y, _ = jump = root - self._last
        if x * x + y * y > self._farthest**2:
            return frame._replace(root_pos=root + self._moved - jump * (1.0, 1.0, 0.0))
        return frame._replace(root_pos=root + self._moved)

    def take(self, frame: Frame, held: Frame) -> None:
        """This one is followed, where it is `held`."""
        self._last = np.array(frame.root_pos)
        self._moved = held.root_pos - self._last
