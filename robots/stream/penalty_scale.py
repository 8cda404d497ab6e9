"""How firm a stream's walls are, frame by frame.

The floor, other parts and the speed of hinges are soft penalties: where a body lands hard, other
residuals outweigh them. Whole clips are solved again there with firmer ones
(`robots.solver.repair`, a penalty method: Nocedal and Wright, "Numerical Optimization", 17.1). A
frame of a stream is solved once with each frame that comes while it is free: firmer each time.
"""

import numpy as np
from jaxtyping import Float

from robots.solver.repair import PENALTY_GROWTH

MAX_OVERSPEED = 2.0  # [rad/s] of a hinge beyond the speed at which it is held back
_MOST = PENALTY_GROWTH**3  # as often as a frame is solved
_SOUND = 0.5  # of that is what firmer walls may hold back: softer ones might not


class PenaltyScale:
    """The `scale` of the penalties of each of some frames."""

    def __init__(self, frames: int) -> None:
        self._frames = frames
        self.reset()

    def reset(self) -> None:
        """Nothing has been broken."""
        self.scale: Float[np.ndarray, F] = np.ones(self._frames)

    def move_on(self, strain: Float[np.ndarray, "F"]) -> None:
        """The frames are one later, the newest like the one before it. How far a wall gives way in
        them, over how far it may, makes it firmer beyond 1, and softer again below `_SOUND`."""
        _, *later = self.scale.tolist()
        scales = zip((*later, float(self.scale[-1])), strain.tolist(), strict=True)
        self.scale = np.array([min(max(s * _growth(x), 1.0), _MOST) for s, x in scales])


def _growth(strain: float) -> float:
    return PENALTY_GROWTH if strain > 1 else 1 / PENALTY_GROWTH if strain < _SOUND else 1.0
