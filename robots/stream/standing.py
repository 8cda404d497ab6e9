"""Which heels and toes of a stream's source stand.

They are slow and low. Of feet that tremble that is told by a line through their last places, the
longer the more they do. Recorded feet creep: where none is slow enough and the body does not fall
freely, the slowest and lowest one carries it. `robots.solver.contacts` sees the whole clip.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from robots.solver.contacts import CREEP_TIME, FLIGHT_PUSH
from robots.solver.creeping import MAX_CREEP
from robots.stream.frame_targets import FrameReader, FrameTargets
from spark.constants import GRAVITY
from spark.rig.contacts import (
    ADULT_HEIGHT,
    MAX_TILT,
    PLANTED_HEIGHT,
    PLANTED_SPEED,
    SPEED_WINDOW,
)
from spark.transfer.noise import BORNE_SPEED, LEEWAY
from spark.transfer.soles import SAME_HEIGHT
from spark.transfer.treads import MIN_PUSH, MIN_STEP

_RELEASE_FACTOR = (
    1.5  # times the speed and height at which a foot comes to stand: there it is let go
)
_UNDER_MASS = 0.3  # [m, of an adult] from a foot that steps up to below the centre of mass
_LONGEST = 0.5  # [s] over which a foot's speed is told where it trembles
_ON_FEET = 0.6  # hips' heights of a T-pose above which nothing but feet carries a body

Ends = list[tuple[bool, bool]]
"""Of heel and toes of each foot."""


class SourceFeet(NamedTuple):
    """The heel and toes of each of a source's feet in one frame, in plain numbers: their places
    over the floor [m, x + iy] and heights over where they stand on it [m], both the source's own;
    where its centre of mass is over the floor [m], too; and how high this and its hips are [m],
    scaled."""

    places: list[list[complex]]
    heights: list[list[float]]
    middle: complex
    hips: float
    com: float

    def before(self, later: "SourceFeet", times: float) -> "SourceFeet":
        """So many times as far before these as `later` ones are after them. None is under the floor
        that was not."""
        places, heights, later_places, later_heights = map(
            np.array, (self.places, self.heights, later.places, later.heights)
        )
        lowered = heights - times * (later_heights - heights)
        return SourceFeet(
            (places - times * (later_places - places)).tolist(),
            np.maximum(lowered, np.minimum(heights, 0.0)).tolist(),
            self.middle - times * (later.middle - self.middle),
            self.hips - times * (later.hips - self.hips),
            self.com - times * (later.com - self.com),
        )


class Standing:
    """Of sources that `reader` reads, `frame_time` [s] apart."""

    def __init__(self, reader: FrameReader, frame_time: float) -> None:
        self._frame_time, self._scale = frame_time, float(reader.scale)
        self._low, self._has_foot = reader.ground.low, reader.has_feet.tolist()
        size = float(reader.source.standing_height / ADULT_HEIGHT)
        self._max_speed, self._max_height = PLANTED_SPEED * size, PLANTED_HEIGHT * size
        self._max_creep, self._max_tilt = MAX_CREEP * size, MAX_TILT * size
        self._least_step, self._under_mass = MIN_STEP * size, _UNDER_MASS * size
        self._off = SAME_HEIGHT * size
        self._on_feet = _ON_FEET * float(reader.robot.rig.hip_height)
        self._reach = max(1, round(SPEED_WINDOW / 2 / frame_time))
        self._creep = max(1, round(CREEP_TIME / frame_time))
        self._most = max(2 * self._reach + 1, round(_LONGEST / frame_time))
        self.history = max(self._most, self._creep, 2 * self._reach)
        """How many frames before one it is told by, at most."""
        self._noise = -1.0
        self.listen(0.0)

    def listen(self, noise: float) -> None:
        """To feet with such noise [m, RMS an axis]: over how many frames speeds are told (0: the
        fewest), and by how much they may be faster. A slope's standard deviation is sqrt(12 / n³)
        that of a frame (least squares)."""
        if noise == self._noise:
            return
        self._noise, fewest = noise, 2 * self._reach + 1
        borne = self._max_speed * BORNE_SPEED / PLANTED_SPEED * self._frame_time
        count = int(np.ceil(np.cbrt(12 * (noise / borne) ** 2)))
        self._window = min(max(count, fewest), self._most) if noise else 0
        left = noise / self._frame_time * np.sqrt(12 / max(self._window, fewest) ** 3)
        self._slow = self._max_speed * float(np.hypot(1.0, LEEWAY * left / self._max_speed))

    def feet(self, targets: FrameTargets) -> SourceFeet:
        """Those of a frame."""
        places = targets.feet[..., :2].view(np.complex128)[..., 0].tolist()
        heights = (targets.feet[..., 2] - self._low).tolist()
        x, y, com = targets.com.tolist()
        middle = complex(x, y) / self._scale
        return SourceFeet(places, heights, middle, float(targets.hips[2]), com)

    def motion(
        self, frames: Sequence[SourceFeet], at: int
    ) -> tuple[list[list[float]], list[list[float]]]:
        """How fast heels and toes are [m/s], and how high over where they stand [m], in one of some
        frames."""
        newest = len(frames) - 1
        if self._window:
            last = min(newest, at + self._window // 2)
            return self._smooth_motion(frames[last - self._window + 1 : last + 1])
        after = min(self._reach, newest - at)
        time = (self._reach + after) * self._frame_time
        ends = zip(frames[at + after].places, frames[at - self._reach].places, strict=True)
        speeds = [[abs(a - b) / time, abs(c - d) / time] for (a, c), (b, d) in ends]
        return speeds, frames[at].heights

    def of(
        self,
        frames: Sequence[SourceFeet],
        at: int,
        stood: Ends,
        speeds: list[list[float]],
        heights: list[list[float]],
        ground: list[float],
    ) -> Ends:
        """Whether heels and toes stand in one of some frames that `stood` in the one before; they
        are so fast [m/s] and so high [m] there, over a floor above which the `ground` is so high
        [m] under each foot. It changes where one stands on something else."""
        stands = []
        feet = zip(self._has_foot, stood, speeds, heights, ground, strict=True)
        for has_foot, (heel_stood, toes_stood), speed, (heel_height, toe_height), under in feet:
            heel = has_foot and self._stands(heel_stood, speed[0], heel_height - under)
            toes = has_foot and self._stands(toes_stood, speed[1], toe_height - under)
            # Who stands on the toes does not stand on the heel.
            heel = heel and (not toes or heel_height < toe_height + self._max_tilt)
            stands.append((heel, toes))
        if not any(map(any, stands)) and self._carried_by_feet(frames, at, FLIGHT_PUSH):
            passed = frames[at - self._creep : at + 1]
            s = self._steps_up(passed, ground)
            if s is not None and self._carried_by_feet(frames, at, MIN_PUSH):
                heel_height, toe_height = heights[s]
                ground[s] = min(heel_height, toe_height)
                stands[s] = (heel_height < ground[s] + self._max_tilt, toe_height <= ground[s])
                return stands
            creeping = self._creeping(passed, ground).tolist()
            return [(heel, toes) for heel, toes in creeping]
        return stands

    def below(self, heights: list[list[float]], known: Sequence[float]) -> list[float]:
        """What feet that are so high are over [m]: the highest ground that any is known to have
        stood on."""
        return [
            max((top for top in known if top < min(ends) + self._off), default=0.0)
            for ends in heights
        ]

    def _steps_up(self, frames: Sequence[SourceFeet], ground: list[float]) -> int | None:
        """Which foot, nearer to the mass than any other and still all through some frames, is a
        step higher than the ground that is known."""
        if self._window:
            return None
        first, last = frames[0], frames[-1]
        away = [
            min(abs(place - last.middle) for place in ends) if has_foot else np.inf
            for ends, has_foot in zip(last.places, self._has_foot, strict=True)
        ]
        s = int(np.argmin(away))
        heights = [min(feet.heights[s]) for feet in frames]
        low = int(np.argmin(last.heights[s]))
        moved = abs(last.places[s][low] - first.places[s][low])
        still = moved < self._max_speed * self._creep * self._frame_time
        still &= max(heights) - min(heights) < self._max_tilt
        up = heights[-1] > ground[s] + self._least_step
        return s if up and still and away[s] < self._under_mass else None

    def _stands(self, stood: bool, speed: float, height: float) -> bool:
        factor = _RELEASE_FACTOR if stood else 1.0
        return speed < factor * self._slow and height < factor * self._max_height

    def _smooth_motion(
        self, frames: Sequence[SourceFeet]
    ) -> tuple[list[list[float]], list[list[float]]]:
        """How heels and toes move in the middle of some frames, through which they tremble."""
        time = np.arange(self._window) - (self._window - 1) / 2
        slope = np.tensordot(time, [feet.places for feet in frames], 1) / (time @ time)
        heights = np.mean([feet.heights for feet in frames], axis=0)
        return (np.abs(slope) / self._frame_time).tolist(), heights.tolist()

    def _carried_by_feet(self, frames: Sequence[SourceFeet], at: int, push: float) -> bool:
        """Whether a body is high enough to be on its feet, and is given so much `push` [body
        weights] at least: it does not fall freely."""
        if not any(self._has_foot) or frames[at].hips < self._on_feet:
            return False
        middle = min(at, len(frames) - 1 - self._reach)
        below, here, above = (frames[middle + k * self._reach].com for k in (-1, 0, 1))
        fall = (2 * here - below - above) / (self._reach * self._frame_time) ** 2 / self._scale
        return fall <= (1 - push) * GRAVITY

    def _creeping(
        self, frames: Sequence[SourceFeet], ground: list[float]
    ) -> Bool[np.ndarray, "S 2"]:
        """The slowest and lowest heel or toe over some frames, and those that are as low and go
        along with it where all feet have one: a body that sways, and its feet with it."""
        first, last = np.array([frames[0].places, frames[-1].places])
        velocity = (last - first) / (self._creep * self._frame_time)
        speed = np.abs(velocity)
        height: Float[np.ndarray, "S 2"] = np.mean([feet.heights for feet in frames], axis=0)
        height = height - np.array(ground)[:, None]
        lower = height < height.min(axis=1, keepdims=True) + self._max_tilt
        lower &= np.array(self._has_foot)[:, None]
        cost = np.where(lower, speed / self._max_speed + height / self._max_height, np.inf)
        best = np.unravel_index(cost.argmin(), cost.shape)
        along = lower & (np.abs(velocity - velocity[best]) < self._max_speed)
        along &= np.abs(height - height[best]) < self._max_tilt
        if not along.any(axis=1).all():
            along = np.zeros_like(along)
            along[best] = True
        return np.logical_and(along, speed < self._max_creep)
