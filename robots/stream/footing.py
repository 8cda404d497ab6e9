"""The contacts of a stream's feet, and the robot's footholds.

A foot is held where it comes down. What the source's foot wobbles while it stands is lost, what it
drifts beyond that is motion and stays; as in `robots.solver.footprints`, which sees the whole clip.
A foot in swing is as high as the source's, scaled, and as it is pitched; an end of it that is fast
steps, as there.
"""

import cmath
from collections import deque
from typing import NamedTuple

import numpy as np
from jaxtyping import Complex, Float

from robots.solver.foot_path import (
    MAX_UNEVEN,
    RAISED_HOLD,
    SWING_HOLD,
    SWING_REACH,
    step_height,
)
from robots.solver.footprints import MAX_WOBBLE, flat_sole, on_points
from robots.solver.window_targets import PointTargets
from robots.stream.foot import Foot
from robots.stream.frame_targets import FrameReader, FrameTargets
from robots.stream.standing import SourceFeet, Standing

HOLD_TIME = 0.1  # [s] over which a foot is taken hold of, and let go

_RAISED, _SWING = float(RAISED_HOLD[0]), float(SWING_HOLD[2])


class _Arrived(NamedTuple):
    """A frame of the source: how high the robot's soles should be and where their points from each
    other, how far each foot's heel and toes have moved over the floor since the frame before [m,
    x + iy, scaled], and how far the robot's feet should have turned about the vertical [rad]."""

    clearance: list[float]
    pitched: Float[np.ndarray, "P 3"]
    moved: list[tuple[complex, complex]]
    turned: list[float]


class ContactTracker:
    """The contacts of a stream's feet and the robot's footholds, with a lookahead of `ahead`
    frames."""

    def __init__(self, reader: FrameReader, frame_time: float, ahead: int) -> None:
        # Plain numbers: numpy's take three times as long.
        self._robot, self._scale = reader.robot, float(reader.scale)
        self._standing = Standing(reader, frame_time)
        self._grip, self._ahead = frame_time / HOLD_TIME, ahead
        hip_height = float(self._robot.rig.hip_height)
        self._hip_height, self._wobble = hip_height, MAX_WOBBLE * hip_height
        self._uneven, self._kick = MAX_UNEVEN * hip_height, SWING_REACH * hip_height
        self._index_points()
        self._arrived: deque[_Arrived] = deque(maxlen=ahead + 1)
        self._source: deque[SourceFeet] = deque(maxlen=self._standing.history + ahead + 1)
        self._last_axes: Complex[np.ndarray, "S 3"] = np.zeros((0, 3), dtype=complex)
        self._feet = [Foot() for _ in self._robot.soles]

    def update(
        self, targets: FrameTargets, points: Float[np.ndarray, "P 3"], noise: float = 0.0
    ) -> PointTargets:
        """Takes in the newest frame, and says how the feet stand in those since `ahead` before it;
        the points of the robot's soles are at `points` in the first of these. How they stand in
        that one is settled then; of the later ones it is what can be seen so far. The source's feet
        came with so much noise [m, RMS an axis]."""
        first = not self._source
        self._standing.listen(noise)
        self._take_in(targets)
        frames = list(self._source)
        settled = len(frames) - 1 - self._ahead
        motion = [self._standing.motion(frames, at) for at in range(settled, len(frames))]
        speeds = self._scale * np.array([speeds for speeds, _ in motion])
        steps = step_height(speeds, self._hip_height).tolist()
        feet, numbers, places = self._feet, [], []
        for at, (arrived, (speed, height), step) in enumerate(
            zip(self._arrived, motion, steps, strict=True), settled
        ):
            stood = [foot.planted for foot in feet]
            stands = self._standing.of(frames, at, stood, speed, height)
            for s, foot in enumerate(feet):
                clearance = arrived.clearance[s]
                moved, turned = arrived.moved[s], arrived.turned[s]
                foot.move_on(stands[s], clearance, moved, turned, self._wobble)
                # Where a foot will come down that is still in the air is not known yet.
                known = foot.is_held or at == settled
                if at == settled and not foot.is_held:
                    own = [complex(x, y) for x, y, _ in points[self._points[s]].tolist()]
                    foot.footprint.put(own, self._lengths[s], on_toe=foot.on_toe)
                foot.grip(self._grip, 1.0 if first else self._grip)
                pace = self._scale * speed[s][1] / self._hip_height
                up = foot.height(clearance, pace, self._uneven)
                numbers += self._held(foot.holds, step[s], up, known=known)
                places.append((foot.footprint.pivot, cmath.rect(1.0, foot.footprint.heading)))
            if at == settled:
                feet = [foot.copy() for foot in feet]
        shape = self._ahead + 1, len(feet)
        return self._targets(
            np.array([arrived.pitched for arrived in self._arrived]),
            np.array(numbers).reshape(shape[0], -1, 4),
            np.array(places, dtype=complex).reshape(*shape, 2),
        )

    def _take_in(self, targets: FrameTargets) -> None:
        """The newest frame; before a first one, the source has stood still."""
        own, axes = self._standing.feet(targets), self._axes_over_floor(targets)
        first = not self._source
        last, last_axes = (own, axes) if first else (self._source[-1], self._last_axes)
        moved = [
            (self._scale * (heel - last_heel), self._scale * (toe - last_toe))
            for (heel, toe), (last_heel, last_toe) in zip(own.places, last.places, strict=True)
        ]
        turns = zip(last_axes, axes, strict=True)
        turned = [cmath.phase(np.vdot(before, now)) for before, now in turns]
        arrived = _Arrived(targets.clearance.tolist(), targets.pitched, moved, turned)
        self._arrived.extend([arrived] * (self._ahead + 1 if first else 1))
        self._source.extend([own] * (self._standing.history + self._ahead + 1 if first else 1))
        self._last_axes = axes

    def _axes_over_floor(self, targets: FrameTargets) -> Complex[np.ndarray, "S 3"]:
        """The axes of the robot's feet, seen from above: x + iy. Of a turn between two such triples
        about the vertical their product says the angle."""
        world = targets.world.take(self._foot_joints, axis=0)
        axes: Complex[np.ndarray, "S 3"] = world[:, 0] + 1j * world[:, 1]
        return axes

    def _held(
        self, holds: tuple[float, float], steps: list[float], up: float, *, known: bool
    ) -> list[tuple[float, float, float, float]]:
        """Of a foot's heel, ball and toes, where heel and toes are held so far and step so high
        [m], and the sole is so high [m] where not held: how far each is held, how high its lowest
        point is [m], and how firmly that is asked for along the floor, if it is `known` where, and
        in height. The ball leaves the floor with either end."""
        (heel, toes), (heel_step, toe_step) = holds, steps
        most = max(heel, toes)
        sole, turning = (1 - most) * up, _RAISED * most
        near = _SWING / (1 + (up / self._kick) ** 2)
        ends = (
            (heel, heel_step),
            (min(heel, toes), max(heel_step, toe_step)),
            (toes, toe_step),
        )
        return [
            (
                hold,
                max(sole, (1 - hold) * step),
                max(hold, turning) if known else 0.0,
                hold + near * (1 - hold),
            )
            for hold, step in ends
        ]

    def _targets(
        self,
        pitched: Float[np.ndarray, "T P 3"],
        held: Float[np.ndarray, "T E 4"],
        places: Complex[np.ndarray, "T S 2"],
    ) -> PointTargets:
        """Where the soles' points are held, and how firmly: `held` is that of the ends of the feet,
        as `_held` has it, and in `places` are the middle of its toes [m, x + iy], and a unit along
        it, of each foot."""
        hold, low, along_floor, in_height = held.transpose(2, 0, 1).take(self._end, axis=2)
        pivot, along = places.transpose(2, 0, 1).take(self._sole, axis=2)
        raised = pitched[..., :2].view(np.complex128)[..., 0]
        away = self._flat - raised
        # What is raised turns about what stands.
        shift = (hold * away) @ self._beside / np.maximum(hold @ self._beside, 1e-9)
        positions, shares = np.empty((2, *hold.shape, 3))
        over_floor = positions[..., :2].view(np.complex128)[..., 0]
        over_floor[:] = pivot + along * (raised + shift + hold * (away - shift))
        positions[..., 2] = (1 - hold) * pitched[..., 2] + low
        shares[..., :2] = along_floor[..., None]
        shares[..., 2] = in_height
        return PointTargets(positions, shares)

    def _index_points(self) -> None:
        """Of all points of the soles: which sole's they are, where on the floor from the middle of
        its toes, and with which of heel and toe they leave it."""
        soles = self._robot.soles
        self._foot_joints = np.array([sole.foot for sole in soles], dtype=int)
        counts = [len(sole) for sole in soles]
        stops = np.cumsum(counts, dtype=int).tolist()
        self._points = [slice(n - count, n) for n, count in zip(stops, counts, strict=True)]
        self._sole = np.repeat(np.arange(len(soles)), counts)
        self._beside = (self._sole[:, None] == self._sole).astype(np.float64)
        flat, ends = [np.zeros(0, dtype=complex)], [np.zeros(0, dtype=int)]
        for k, sole in enumerate(soles):
            points = flat_sole(self._robot, sole) @ (1, 1j)
            flat.append(points - points[-2:].mean())
            heel, toes = on_points(sole, np.eye(2)).T
            ends.append(3 * k + 1 + (toes - heel).astype(int))
        self._lengths = [-float(points[:2].real.mean()) for points in flat[1:]]
        self._flat, self._end = np.concatenate(flat), np.concatenate(ends)
