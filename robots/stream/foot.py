"""How one foot of a stream's robot stands, frame by frame."""

import math
from dataclasses import dataclass, field, replace

from robots.solver.foot_path import STEP_SPEEDS
from robots.stream.footprint import Footprint

_STILL, _STEPS = STEP_SPEEDS[:2]
CLIMB_SPEED = 1.0  # [hip heights/s] of a sole to a ground that is seen only once it is stood on
_SETTLE_TIME = 1.0  # [s] in which a foot on a step comes down most of the way to its source's


def settling(frame_time: float) -> float:
    """The share of what a foot on a step is too high that is lost in a frame."""
    return 1 - math.exp(-frame_time / _SETTLE_TIME)


@dataclass(slots=True)
class Foot:
    """Whether heel and toes of the source's foot stand, how far the robot's are held (0 to 1), over
    what its soles last stood [m, scaled], and where it is held. On what climbs over the floor, that
    is at `top` [m, the source's own], its soles are at `rise` [m, scaled]."""

    planted: tuple[bool, bool] = (False, False)
    holds: tuple[float, float] = (0.0, 0.0)
    ground: float = 0.0
    footprint: Footprint = field(default_factory=Footprint)
    top: float = 0.0
    rise: float = 0.0

    @property
    def is_held(self) -> bool:
        """Whether heel or toes are."""
        heel, toes = self.holds
        return heel > 0 or toes > 0

    @property
    def freedom(self) -> tuple[float, float]:
        """How far (0 to 1) heel and toes may rise. What is let go does at once, before it moves
        over the floor: it would drag."""
        (heel, toes), (heel_stands, toes_stand) = self.holds, self.planted
        return 1.0 - heel * heel_stands, 1.0 - toes * toes_stand

    @property
    def on_toe(self) -> bool:
        """Whether it is the toes that it goes along with, and not the heel."""
        return self.planted[1] or not self.planted[0]

    def copy(self) -> "Foot":
        """One that goes on by itself."""
        return replace(self, footprint=self.footprint.copy())

    def move_on(
        self,
        planted: tuple[bool, bool],
        clearance: float,
        moved: tuple[complex, complex],
        turned: float,
        wobble: float,
    ) -> None:
        """The next frame of the source, in which heel and toes stand or not, soles are so high [m],
        and have moved [m] and turned [rad] since the one before. What is held goes along."""
        if True in planted:
            self.ground = min(self.ground, clearance) if True in self.planted else clearance
        self.planted = planted
        hold = max(self.holds)
        if hold > 0:
            self.footprint.follow(moved[self.on_toe], turned, hold, wobble)

    def stand_on(
        self, top: float, clearance: float, own: float, settles: float, climbs: float
    ) -> None:
        """What so high a ground [m, the source's own] over the floor its soles are on, so high [m,
        scaled] there; the robot's are at `own` [m]. It rises with the highest frame, by so much at
        most, and settles on the others by a share of what it is over them. Who stands a little too
        high sinks into nothing."""
        stays = True in self.planted and top == self.top
        before = self.rise if stays else max(own, 0.0)
        rise = max(clearance, before + settles * (clearance - before)) if stays else clearance
        self.top, self.rise = top, min(rise, before + climbs) if top > 0 else 0.0

    def grip(self, loosens: float, tightens: float) -> None:
        """Take hold of what stands, and let go of the rest, by so much at most."""
        (heel, toes), (heel_stands, toes_stand) = self.holds, self.planted
        heel = min(heel + tightens, 1.0) if heel_stands else max(heel - loosens, 0.0)
        toes = min(toes + tightens, 1.0) if toes_stand else max(toes - loosens, 0.0)
        self.holds = heel, toes

    def height(self, clearance: float, pace: float, uneven: float) -> float:
        """How high [m] its sole is in swing: as the source's, scaled; but where it takes no step,
        at so much `pace` [hip heights/s], it is put down by what it last stood over the floor,
        which may be off by `uneven` [m]."""
        if pace >= _STEPS:
            return clearance
        slow = min((_STEPS - pace) / (_STEPS - _STILL), 1.0)
        return clearance - slow * min(self.ground, uneven, max(clearance, 0.0))
