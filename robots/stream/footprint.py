"""Where a foot of a stream is held: put down where the robot's foot is, it follows the source's
beyond what that one wobbles while it stands."""

import cmath
from collections.abc import Sequence
from dataclasses import dataclass

from robots.solver.footprints import MAX_TWIST


@dataclass(slots=True)
class Footprint:
    """The middle of a foot's toes' edge on the floor [m, x + iy] and its heading [rad]; how far the
    source's foot has moved and turned away from there since."""

    pivot: complex = 0j
    heading: float = 0.0
    away: complex = 0j
    turned: float = 0.0

    def copy(self) -> "Footprint":
        """One that goes on by itself."""
        return Footprint(self.pivot, self.heading, self.away, self.turned)

    def put(self, points: Sequence[complex], length: float, *, on_toe: bool) -> None:
        """Where the foot is that has these points on the floor [m, x + iy] and is so long; on its
        heel, where its toes will come down."""
        heel, toe = (points[0] + points[1]) / 2, (points[-2] + points[-1]) / 2
        self.heading = cmath.phase(toe - heel)
        self.pivot = toe if on_toe else heel + cmath.rect(length, self.heading)
        self.away, self.turned = 0j, 0.0

    def follow(self, moved: complex, turned: float, hold: float, wobble: float) -> None:
        """Go along with the source's foot where it is not firmly held, and beyond its wobble."""
        if hold < 1:
            self.pivot += (1 - hold) * moved
            self.heading += (1 - hold) * turned
        away = self.away + hold * moved
        far = abs(away)
        self.away = away * (wobble / far) if far > wobble else away
        self.pivot += away - self.away
        turn = self.turned + hold * turned
        self.turned = min(max(turn, -MAX_TWIST), MAX_TWIST)
        self.heading += turn - self.turned
