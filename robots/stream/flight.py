"""How high a robot is thrown where its source flies.

Heights are scaled, and so is how fast they fall: by that, the floor would have to carry a share of
a small robot in the air. That the source flies is seen when it does. From then on the robot rises
as if it fell nearly as fast as all bodies do; what it has gained is lost again on the way down.
"""

from collections import deque

from spark.constants import GRAVITY

STANDING = 1.06  # hips' heights of a T-pose up to which they stand; above, a body may be thrown
FALL = 0.87  # g; of the rest, 0.13 body weights, the report takes no notice
# g from which on a source that falls so fast flies, and does so surely: below are those who rise on
_FLYING = 0.7, 0.95  # tiptoe, or leap with a foot on the floor
_SPAN = 1 / 15  # [s] over which that is measured


class Flight:
    """Of a robot whose heights are `scale` times those of a source, frame by frame."""

    def __init__(self, scale: float, hip_height: float, frame_time: float) -> None:
        self._scale, self._standing = scale, STANDING * hip_height
        self._reach = max(1, round(_SPAN / 2 / frame_time))
        self._time = self._reach * frame_time
        self._heights: deque[float] = deque(maxlen=2 * self._reach + 1)
        self.reset()

    def reset(self) -> None:
        """Forget what has been seen."""
        self._heights.clear()
        self._over = self._gained = 0.0

    def follow(self, height: float) -> float:
        """How much higher [m] than scaled the robot's hips are, when those of the source are so
        high [m] in the newest frame."""
        self._heights.extend([height] * (1 if self._heights else 2 * self._reach + 1))
        first, middle, last = (self._heights[k * self._reach] for k in range(3))
        fall = (2 * middle - first - last) / self._time**2 / GRAVITY
        over = max(0.0, height - self._standing)
        if over > self._over:
            low, high = _FLYING
            flying = min(max((fall - low) / (high - low), 0.0), 1.0)
            more = max(0.0, FALL / max(fall, low) - self._scale)
            self._gained += flying * more * (over - self._over)
        elif self._over:
            self._gained *= over / self._over
        self._over = over
        return self._gained
