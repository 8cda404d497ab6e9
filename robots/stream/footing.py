"""The contacts of a stream's feet, and the robot's footholds.

A foot is held where it comes down. What the source's foot wobbles while it stands is lost, what it
drifts beyond that is motion and stays; as in `robots.solver.footprints`, which sees the whole clip.
A foot in swing is as high as the source's, scaled, and as it is pitched.
"""

from collections import deque

import numpy as np
from jaxtyping import Float

from robots.solver.foot_path import FAST, SLOW, STEP_HEIGHT, SWING_HOLD
from robots.solver.footprints import MAX_TWIST, MAX_WOBBLE, flat_sole, on_points
from robots.stream.frame_targets import FrameReader, FrameTargets
from robots.stream.terms import FootTargets
from spark.rig.contacts import ADULT_HEIGHT, PLANTED_HEIGHT, PLANTED_SPEED, SPEED_WINDOW

RAMP = 0.05  # [s] over which a foot is taken hold of and let go
_SWING = np.array([0.0, 0.0, SWING_HOLD[2]])  # where it will come down is not known
_RELEASE_FACTOR = (
    1.5  # times the speed and height at which a foot comes to stand: there it is let go
)


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
        self._flat = [flat_sole(self._robot, sole) for sole in self._robot.soles]
        self._length = self._reach + ahead + 1
        self._history: deque[FrameTargets] = deque(maxlen=self._length)
        soles = len(self._robot.soles)
        self._planted = np.zeros((soles, 2), dtype=bool)
        self._holds = np.zeros((soles, 2))
        self._footprints = [Footprint() for _ in range(soles)]

    def update(self, targets: FrameTargets, points: Float[np.ndarray, "P 3"]) -> FootTargets:
        """Takes in the newest frame, and says how the feet stand `ahead` frames before it, when
        the points of the robot's soles are at `points`."""
        first = not self._history
        self._history.extend([targets] * (self._length if first else 1))
        here = len(self._history) - 1 - self._ahead
        now, before = self._history[here], self._history[here - 1]
        after = min(self._reach, self._ahead)
        travelled = self._history[here + after].feet - self._history[here - self._reach].feet
        speed = np.hypot(travelled[..., 0], travelled[..., 1]) / (
            (self._reach + after) * self._frame_time
        )
        height = now.feet[..., 2] - self._low
        swing = np.maximum(now.clearance, self._lift(speed.max(axis=1)))
        factor = np.where(self._planted, _RELEASE_FACTOR, 1.0)
        self._planted = (
            self._has_foot
            & (speed < factor * self._max_speed)
            & (height < factor * self._max_height)
        )
        ramp = 1.0 if first else self._frame_time / RAMP
        step = np.clip(self._planted - self._holds, -ramp, ramp)
        places, holds, end = np.zeros_like(points), np.zeros_like(points), 0
        for s, (sole, footprint) in enumerate(
            zip(self._robot.soles, self._footprints, strict=True)
        ):
            own = slice(end, end := end + len(sole))
            point = int(self._planted[s, 1] or not self._planted[s, 0])
            if not self._holds[s].any():
                footprint.put(points[own], self._flat[s], on_toe=point == 1)
            else:
                moved = self._scale * (now.feet - before.feet)[s, point, :2]
                turn = _yaw_between(before.world[sole.foot], now.world[sole.foot])
                wobble = MAX_WOBBLE * self._robot.rig.hip_height
                footprint.follow(moved, turn, float(self._holds[s].max()), wobble)
            places[own, :2] = footprint.positions(self._flat[s])
            self._holds[s] += step[s]
            held = on_points(sole, self._holds[s])[:, None]
            raised = (1 - held[:, 0]) * now.pitched[own]
            places[own, 2] = raised + (1 - held.max()) * swing[s]
            holds[own] = held + (1 - held) * _SWING
        return FootTargets(places, holds)

    def _lift(self, speed: Float[np.ndarray, "S"]) -> Float[np.ndarray, "S"]:
        """How high [m] feet step that are as fast in the source [m/s]: as in
        `robots.solver.foot_path`."""
        hip_height = self._robot.rig.hip_height
        share = np.clip((self._scale * speed / hip_height - SLOW) / (FAST - SLOW), 0.0, 1.0)
        lift: Float[np.ndarray, S] = share * STEP_HEIGHT * hip_height
        return lift


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


def _yaw_between(before: Float[np.ndarray, "3 3"], now: Float[np.ndarray, "3 3"]) -> float:
    """The rotation about the vertical [rad] from one frame to the next."""
    R = now @ before.T
    return float(np.arctan2(R[1, 0] - R[0, 1], R[0, 0] + R[1, 1]))
