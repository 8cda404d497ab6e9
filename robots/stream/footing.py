"""The contacts of a stream's feet, and the robot's footholds.

A foot is held where it comes down. What the source's foot wobbles while it stands is lost, what it
drifts beyond that is motion and stays; as in `robots.solver.footprints`, which sees the whole clip.
A foot in swing is as high as the source's, scaled, and as it is pitched.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from robots.solver.foot_path import FAST, RAISED_HOLD, SLOW, STEP_HEIGHT, SWING_HOLD
from robots.solver.footprints import MAX_WOBBLE, flat_sole, on_points
from robots.stream.footprint import Footprint, yaw_between
from robots.stream.frame_targets import FrameReader, FrameTargets
from robots.stream.terms import FootTargets
from spark.rig.contacts import ADULT_HEIGHT, PLANTED_HEIGHT, PLANTED_SPEED, SPEED_WINDOW

RAMP = 0.05  # [s] over which a foot is taken hold of and let go
_SWING = np.array([0.0, 0.0, SWING_HOLD[2]])  # held: its height alone
_RELEASE_FACTOR = (
    1.5  # times the speed and height at which a foot comes to stand: there it is let go
)


class _Seen(NamedTuple):
    """Of the feet in one frame: how far heels and toes are held, how high [m] they are where not,
    whether it is known where, and their footprints."""

    holds: Float[np.ndarray, "S 2"]
    height: Float[np.ndarray, "S"]
    known: Bool[np.ndarray, "S"]
    pivots: tuple[complex, ...]
    headings: tuple[float, ...]


class ContactTracker:
    """The contacts of a stream's feet and the robot's footholds, with a lookahead of `ahead`
    frames."""

    def __init__(self, reader: FrameReader, frame_time: float, ahead: int) -> None:
        self._robot, self._scale = reader.robot, reader.scale
        self._low = reader.ground.low
        self._frame_time, self._ahead = frame_time, ahead
        size = reader.source.standing_height / ADULT_HEIGHT
        self._max_speed, self._max_height = PLANTED_SPEED * size, PLANTED_HEIGHT * size
        self._reach = max(1, round(SPEED_WINDOW / 2 / frame_time))
        self._has_foot = reader.has_feet[:, None]
        ends = np.cumsum([len(sole) for sole in self._robot.soles])
        self._own = [
            slice(end - len(sole), end) for sole, end in zip(self._robot.soles, ends, strict=True)
        ]
        self._wobble = MAX_WOBBLE * self._robot.rig.hip_height
        flat = (flat_sole(self._robot, sole) @ (1, 1j) for sole in self._robot.soles)
        self._flat = [points - points[-2:].mean() for points in flat]  # from the toes' middle
        self._length = self._reach + ahead + 1
        self._history: deque[FrameTargets] = deque(maxlen=self._length)
        soles = len(self._robot.soles)
        self._planted = np.zeros((soles, 2), dtype=bool)
        self._holds = np.zeros((soles, 2))
        self._footprints = [Footprint() for _ in range(soles)]

    def update(self, targets: FrameTargets, points: Float[np.ndarray, "P 3"]) -> FootTargets:
        """Takes in the newest frame, and says how the feet stand in those since `ahead` before it;
        the points of the robot's soles are at `points` in the first of these. How they stand in
        that one is settled then; of the later ones it is what can be seen so far."""
        first = not self._history
        self._history.extend([targets] * (self._length if first else 1))
        settled = len(self._history) - 1 - self._ahead
        ramp = 1.0 if first else self._frame_time / RAMP
        planted, holds, footprints = self._planted, self._holds, self._footprints
        seen = []
        for at in range(settled, len(self._history)):
            planted, height = self._standing(at, planted)
            self._follow(at, planted, holds, footprints)
            # Where a foot will come down that is still in the air is not known yet.
            known = np.logical_or(holds.any(axis=1), at == settled)
            if at == settled:
                self._put(points, planted, holds)
            holds = holds + np.clip(planted - holds, -ramp, ramp)
            pivots = tuple(footprint.pivot for footprint in footprints)
            headings = tuple(footprint.heading for footprint in footprints)
            seen.append(_Seen(holds, height, known, pivots, headings))
            if at == settled:
                self._planted, self._holds = planted, holds
                footprints = [replace(footprint) for footprint in footprints]
        return self._targets([self._history[k] for k in range(settled, len(self._history))], seen)

    def _put(
        self,
        points: Float[np.ndarray, "P 3"],
        planted: Bool[np.ndarray, "S 2"],
        holds: Float[np.ndarray, "S 2"],
    ) -> None:
        """The footprints of feet that are not held yet, where these are."""
        for s in np.flatnonzero(~holds.any(axis=1)).tolist():
            length = -float(self._flat[s][:2].real.mean())
            on_toe = bool(planted[s, 1] or not planted[s, 0])
            self._footprints[s].put(points[self._own[s]], length, on_toe=on_toe)

    def _standing(
        self, at: int, planted: Bool[np.ndarray, "S 2"]
    ) -> tuple[Bool[np.ndarray, "S 2"], Float[np.ndarray, "S"]]:
        """Whether heels and toes stand that were `planted` in the frame before, and how high [m]
        the soles are that don't."""
        after = min(self._reach, len(self._history) - 1 - at)
        now = self._history[at]
        travelled = self._history[at + after].feet - self._history[at - self._reach].feet
        speed = np.hypot(travelled[..., 0], travelled[..., 1]) / (
            (self._reach + after) * self._frame_time
        )
        height = now.feet[..., 2] - self._low
        factor = np.where(planted, _RELEASE_FACTOR, 1.0)
        planted = (
            self._has_foot
            & (speed < factor * self._max_speed)
            & (height < factor * self._max_height)
        )
        return planted, np.maximum(now.clearance, self._lift(speed.max(axis=1)))

    def _follow(
        self,
        at: int,
        planted: Bool[np.ndarray, "S 2"],
        holds: Float[np.ndarray, "S 2"],
        footprints: Sequence[Footprint],
    ) -> None:
        """Takes those along that were held by `holds` in the frame before."""
        now, last = self._history[at], self._history[at - 1]
        for s in np.flatnonzero(holds.any(axis=1)).tolist():
            point = int(planted[s, 1] or not planted[s, 0])
            moved = self._scale * (now.feet[s, point, :2] - last.feet[s, point, :2])
            foot = self._robot.soles[s].foot
            turned = yaw_between(last.world[foot], now.world[foot])
            footprints[s].follow(complex(*moved), turned, float(holds[s].max()), self._wobble)

    def _targets(self, frames: Sequence[FrameTargets], seen: Sequence[_Seen]) -> FootTargets:
        """Where the soles' points are held, and how firmly."""
        holds, height, known, pivot, heading = (np.array(part) for part in zip(*seen, strict=True))
        places, shares = np.zeros((2, len(frames), sum(map(len, self._robot.soles)), 3))
        pitched = np.stack([frame.pitched for frame in frames])
        for s, (sole, own) in enumerate(zip(self._robot.soles, self._own, strict=True)):
            held = on_points(sole, holds[:, s].T).T
            most = held.max(axis=1, keepdims=True)
            flat = self._flat[s]
            raised = pitched[:, own, :2] @ (1, 1j)
            # What is raised turns about what stands.
            raised += (held * (flat - raised)).sum(1, keepdims=True) / np.maximum(
                held.sum(1, keepdims=True), 1e-9
            )
            over = held * flat + (1 - held) * raised
            place = pivot[:, s, None] + np.exp(1j * heading[:, s, None]) * over
            places[:, own, 0], places[:, own, 1] = place.real, place.imag
            places[:, own, 2] = (1 - held) * pitched[:, own, 2] + (1 - most) * height[:, s, None]
            shares[:, own] = held[..., None] + (1 - held[..., None]) * _SWING
            shares[:, own, :2] = np.maximum(held, RAISED_HOLD[0] * most)[..., None]
            shares[~known[:, s], own, :2] = 0.0
        return FootTargets(places, shares)

    def _lift(self, speed: Float[np.ndarray, "S"]) -> Float[np.ndarray, "S"]:
        """How high [m] feet step that are as fast in the source [m/s]: as in
        `robots.solver.foot_path`."""
        hip_height = self._robot.rig.hip_height
        share = np.clip((self._scale * speed / hip_height - SLOW) / (FAST - SLOW), 0.0, 1.0)
        lift: Float[np.ndarray, S] = share * STEP_HEIGHT * hip_height
        return lift
