"""Where a foot of a stream is held: put down where the robot's foot is, it follows the source's
beyond what that one wobbles while it stands."""

import numpy as np
from jaxtyping import Float

from robots.solver.footprints import MAX_TWIST


class Footprint:
    """Where one foot is held: the middle of its toes' edge, and its heading."""

    def __init__(self) -> None:
        self._pivot, self._away = np.zeros((2, 2))
        self._heading = self._turned = 0.0

    def put(
        self, points: Float[np.ndarray, "P 3"], flat: Float[np.ndarray, "P 2"], *, on_toe: bool
    ) -> None:
        """Where the foot is; on its heel, where its toes will come down."""
        heel, toe = points[:2, :2].mean(0), points[-2:, :2].mean(0)
        along = toe - heel
        self._heading = float(np.arctan2(along[1], along[0]))
        ahead = np.array([np.cos(self._heading), np.sin(self._heading)])
        length = flat[-2:].mean(0)[0] - flat[:2].mean(0)[0]
        self._pivot = toe if on_toe else heel + length * ahead
        self._away, self._turned = np.zeros(2), 0.0

    def follow(
        self, moved: Float[np.ndarray, "2"], turned: float, hold: float, wobble: float
    ) -> None:
        """Go along with the source's foot where it is not firmly held, and beyond its wobble."""
        away = self._away + hold * moved
        far = float(np.hypot(*away))
        self._away = away * min(1.0, wobble / max(far, 1e-12))
        self._pivot = self._pivot + (1 - hold) * moved + (away - self._away)
        turn = self._turned + hold * turned
        self._turned = float(np.clip(turn, -MAX_TWIST, MAX_TWIST))
        self._heading += (1 - hold) * turned + (turn - self._turned)

    def positions(self, flat: Float[np.ndarray, "P 2"]) -> Float[np.ndarray, "P 2"]:
        """Where the points of the sole stand."""
        cos, sin = np.cos(self._heading), np.sin(self._heading)
        return self._pivot + (flat - flat[-2:].mean(0)) @ np.array([[cos, sin], [-sin, cos]])


def yaw_between(before: Float[np.ndarray, "3 3"], now: Float[np.ndarray, "3 3"]) -> float:
    """The rotation about the vertical [rad] from one frame to the next."""
    R = now @ before.T
    return float(np.arctan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1]))
