"""Hands, knees, back and other parts of a stream that come near the ground.

The lower a part of the source is, the more firmly the robot's is as low: what lies on the ground
touches it, by the lowest of the shapes that meet there. While the source's is slow as well, the
robot's stays where it came to rest. `robots.solver.resting` sees the whole clip.
"""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float

from robots.model.morphology import Morphology
from robots.solver.contacts import REST_HEIGHT, REST_SPEED, ROLL_SPEED, WRIST_HEIGHT
from robots.solver.over_feet import on_arms
from robots.solver.resting import carrier
from robots.solver.touching import touches_of
from robots.solver.window_poses import WindowPoses
from robots.solver.window_targets import PointTargets
from robots.solver.window_terms import Terms
from robots.stream.frame_targets import LATENCY, FrameReader, FrameTargets
from spark.rig.contacts import ADULT_HEIGHT, SPEED_WINDOW
from spark.rig.flesh import RADII
from spark.rig.roles import Role
from spark.smoothstep import smoothstep

LEAD_HEIGHT = 0.2  # [m, of an adult] of the source's flesh below which the robot's is led down
HOLD_TIME = 0.1  # [s] over which a part is taken hold of in its place, and let go
_LEAD = LEAD_HEIGHT - REST_HEIGHT
_MAX_ROLL = 0.1  # hip heights that the joint of a part that rests may roll over it
_FELT = 0.01  # of the hold of what lies on the ground, below which it is not worth its time


class _Point(NamedTuple):
    """A point that is held for a part (its number): by `link`, at `place` in the rest pose [m],
    with which share of the part's hold."""

    part: int
    link: int
    place: Float[np.ndarray, "3"]
    share: float


class _Seen(NamedTuple):
    """Of the parts in one frame: how high [m] the robot's should reach down, and how firmly they
    are held there and in their places; the firmest hold there."""

    height: Float[np.ndarray, "K"]
    up: Float[np.ndarray, "K"]
    along: Float[np.ndarray, "K"]
    most: float


def held_points(
    robot: Morphology, parts: Sequence[Role]
) -> list[tuple[int, Float[np.ndarray, "3"]]]:
    """The points by which parts are held: links, and places in the rest pose [m]."""
    return [(point.link, point.place) for point in _points(robot, parts)]


def _points(robot: Morphology, parts: Sequence[Role]) -> list[_Point]:
    """Those of the parts themselves and, of arms and head, which give way to the trunk, those of
    the trunk that carry them."""
    touches = touches_of(robot)
    own = [_Point(k, touches[role].link, touches[role].place, 1.0) for k, role in enumerate(parts)]
    carried = [(k, carrier(robot, role)) for k, role in enumerate(parts)]
    return own + [_Point(k, *point) for k, point in carried if point is not None]


class RestTracker:
    """The parts of a stream that touch the ground, in the newest frame and `LATENCY` before it."""

    def __init__(self, reader: FrameReader, terms: Terms, frame_time: float) -> None:
        robot, source, parts = reader.robot, reader.source, reader.parts
        self._terms, self._frame_time = terms, frame_time
        self._scale, self._adult = reader.scale, source.standing_height / ADULT_HEIGHT
        flesh = np.array([RADII[role.part] for role in parts]) * source.standing_height
        palms = np.array([role.part == "hand" for role in parts]) * WRIST_HEIGHT * self._adult
        self._floor = reader.ground.z
        self._lying = self._floor + flesh + palms
        self._arms = np.array([role.part in ("hand", "forearm") for role in parts], dtype=bool)
        self._roll = _MAX_ROLL * robot.rig.hip_height
        points = _points(robot, parts)
        self._part = np.array([point.part for point in points], dtype=int)
        self._share = np.array([point.share for point in points])
        touches = [touches_of(robot)[role].around for role in parts]
        self._under = terms.under([solid for around in touches for solid in around])
        spheres = [sum(len(solid.spheres) for solid in around) for around in touches]
        self._first_spheres = np.cumsum([0, *spheres[:-1]], dtype=int)
        self._reach = max(1, round(SPEED_WINDOW / frame_time))
        self._places: deque[Float[np.ndarray, "K 3"]] = deque(maxlen=self._reach + 1)
        self._seen: deque[_Seen] = deque(maxlen=LATENCY + 1)
        self._rests = np.zeros(len(parts), dtype=bool)
        self._along = np.zeros(len(parts))
        self._held, self._rolled = np.zeros((2, len(parts)), dtype=complex)

    def begin(self, first: FrameTargets, later: FrameTargets, frames: int) -> None:
        """How the source has moved before its first frame (`ContactTracker.begin`)."""
        step = (later.parts - first.parts) / frames
        self._places.extend(first.parts - k * step for k in range(self._reach + 1, 0, -1))

    def update(self, targets: FrameTargets, poses: WindowPoses) -> PointTargets | None:
        """Takes in the newest frame. Where the parts are held in the last frames, the robot being
        in `poses` in the first of these; None where nothing is near the ground."""
        self._places.append(targets.parts)
        seen = self._look(targets)
        self._seen.extend([seen] * (1 if self._seen else LATENCY + 1))
        if all(frame.most < _FELT for frame in self._seen):
            self._along[:] = 0.0
            return None
        up, along = (
            np.array(part) for part in zip(*((s.up, s.along) for s in self._seen), strict=True)
        )
        points = self._terms.part_points(poses)[0]
        own = points[: len(self._along), :2] @ (1, 1j)
        self._follow(own)
        depth = np.maximum.reduceat(self._under.depth(poses)[0], self._first_spheres)
        moved = np.zeros((len(up), len(own), 3))
        away = self._held - own
        moved[..., 0], moved[..., 1] = away.real, away.imag
        moved[..., 2] = np.array([s.height for s in self._seen]) + depth
        holds = np.stack([along * up, along * up, up], axis=-1)
        return PointTargets(
            points + moved[:, self._part], self._share[:, None] * holds[:, self._part]
        )

    def _look(self, targets: FrameTargets) -> _Seen:
        """How the source's parts are in the newest frame."""
        now, before = self._places[-1], self._places[0]
        height = (now[:, 2] - self._lying) / self._adult
        over = np.maximum(height - REST_HEIGHT, 0.0)
        if over.min(initial=np.inf) >= _LEAD and not self._along.any():
            self._rests, self._free = np.zeros(len(over), bool), np.ones(len(over), bool)
            up, self._along = np.zeros((2, len(over)))
            return _Seen(self._scale * self._adult * over, up, self._along, 0.0)
        elapsed = (len(self._places) - 1) * self._frame_time
        speed = np.linalg.norm(now - before, axis=1) / elapsed / self._adult
        limit = np.where(self._rests, ROLL_SPEED, REST_SPEED)
        self._rests = (height < REST_HEIGHT) & (speed < limit)
        up = smoothstep(1 - over / _LEAD)
        if up[self._arms].any():
            feet = targets.feet.reshape(1, -1, 3) - np.array([0.0, 0.0, self._floor])
            up[self._arms] *= on_arms(targets.com[None, :2] / self._scale, feet, self._adult)
        grip = self._frame_time / HOLD_TIME
        self._free = self._along == 0
        self._along = self._along + np.clip(self._rests - self._along, -grip, grip)
        most = float(up.max(initial=0.0))
        return _Seen(self._scale * self._adult * over, up, self._along, most)

    def _follow(self, own: Complex[np.ndarray, "K"]) -> None:
        """Parts are held where they came to rest; with the source's, where that goes on beyond what
        a joint rolls over what rests."""
        now, before = self._places[-1], self._places[-2]
        moved = self._scale * ((now - before)[:, :2] @ (1, 1j))
        rolled = self._rolled + moved
        self._rolled = rolled * np.minimum(1.0, self._roll / np.maximum(np.abs(rolled), 1e-12))
        self._held = self._held + (rolled - self._rolled)
        self._held, self._rolled = (
            np.where(self._free, start, value)
            for start, value in ((own, self._held), (0j, self._rolled))
        )
