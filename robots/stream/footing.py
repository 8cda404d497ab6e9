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
    near_floor,
    step_height,
)
from robots.solver.footprints import MAX_WOBBLE, flat_sole, on_points
from robots.solver.window_targets import PointTargets
from robots.stream.foot import Foot
from robots.stream.frame_targets import FrameReader, FrameTargets
from robots.stream.standing import Standing

HOLD_TIME = 0.1  # [s] over which a foot is taken hold of, and let go


class _Arrived(NamedTuple):
    """A frame of the source: how far each foot's heel and toes have moved over the floor since the
    one before [m, x + iy, scaled], and how far the robot's feet should have turned about the
    vertical [rad]."""

    targets: FrameTargets
    moved: list[tuple[complex, complex]]
    turned: list[float]


class ContactTracker:
    """The contacts of a stream's feet and the robot's footholds, with a lookahead of `ahead`
    frames."""

    def __init__(self, reader: FrameReader, frame_time: float, ahead: int) -> None:
        self._robot, self._scale = reader.robot, reader.scale
        self._standing = Standing(reader, frame_time)
        self._grip, self._ahead = frame_time / HOLD_TIME, ahead
        hip_height = self._robot.rig.hip_height
        self._hip_height, self._wobble = hip_height, MAX_WOBBLE * hip_height
        self._uneven = MAX_UNEVEN * hip_height
        self._index_points()
        self._length = self._standing.history + ahead + 1
        self._history: deque[_Arrived] = deque(maxlen=self._length)
        self._feet = [Foot() for _ in self._robot.soles]

    def update(
        self, targets: FrameTargets, points: Float[np.ndarray, "P 3"], noise: float = 0.0
    ) -> PointTargets:
        """Takes in the newest frame, and says how the feet stand in those since `ahead` before it;
        the points of the robot's soles are at `points` in the first of these. How they stand in
        that one is settled then; of the later ones it is what can be seen so far. The source's feet
        came with so much noise [m, RMS an axis]."""
        first = not self._history
        self._standing.listen(noise)
        arrived = self._arrived(targets, targets if first else self._history[-1].targets)
        self._history.extend([arrived] * (self._length if first else 1))
        settled = len(self._history) - 1 - self._ahead
        frames = [arrived.targets for arrived in self._history]
        speeds, heights = self._standing.motion(frames, settled)
        steps = step_height(self._scale * speeds, self._hip_height).tolist()
        feet, numbers, places = self._feet, [], []
        for at, (speed, height, step) in enumerate(
            zip(speeds.tolist(), heights.tolist(), steps, strict=True), settled
        ):
            _, moved, turned = self._history[at]
            stands = self._standing.of(frames, at, [foot.planted for foot in feet], speed, height)
            clearances = frames[at].clearance.tolist()
            for s, foot in enumerate(feet):
                clearance = clearances[s]
                foot.move_on(stands[s], clearance, moved[s], turned[s], self._wobble)
                # Where a foot will come down that is still in the air is not known yet.
                known = foot.is_held or at == settled
                if at == settled and not foot.is_held:
                    own = [complex(x, y) for x, y, _ in points[self._points[s]].tolist()]
                    foot.footprint.put(own, self._lengths[s], on_toe=foot.on_toe)
                foot.grip(self._grip, 1.0 if first else self._grip)
                pace = self._scale * speed[s][1] / self._hip_height
                up = foot.height(clearance, pace, self._uneven)
                numbers += [*foot.holds, *step[s], up, float(known)]
                places += [foot.footprint.pivot, cmath.rect(1.0, foot.footprint.heading)]
            if at == settled:
                feet = [foot.copy() for foot in feet]
        shape = self._ahead + 1, len(feet)
        return self._targets(
            np.array([frame.pitched for frame in frames[settled:]]),
            np.array(numbers).reshape(*shape, 6),
            np.array(places, dtype=complex).reshape(*shape, 2),
        )

    def _arrived(self, now: FrameTargets, last: FrameTargets) -> _Arrived:
        by = self._scale * (now.feet - last.feet)
        moved = (by[..., 0] + 1j * by[..., 1]).tolist()
        R = now.world.take(self._foot_joints, axis=0)
        R = R @ last.world.take(self._foot_joints, axis=0).transpose(0, 2, 1)
        turned = np.arctan2(R[:, 1, 0] - R[:, 0, 1], R[:, 0, 0] + R[:, 1, 1])
        return _Arrived(now, [(heel, toe) for heel, toe in moved], turned.tolist())

    def _targets(
        self,
        pitched: Float[np.ndarray, "T P 3"],
        numbers: Float[np.ndarray, "T S 6"],
        places: Complex[np.ndarray, "T S 2"],
    ) -> PointTargets:
        """Where the soles' points are held, and how firmly. Of each foot there are, in `numbers`,
        how far heel and toes are held, how high [m] they step and the sole is where not held, and
        whether it is known where; in `places` the middle of its toes [m, x + iy], and a unit along
        it."""
        of_points = numbers.take(self._sole, axis=1)
        pivot, along = places.take(self._sole, axis=1).transpose(2, 0, 1)
        height, known = of_points[..., 4:].transpose(2, 0, 1)
        ends = of_points[..., :2]
        on, step = np.maximum(ends, self._stays_with), of_points[..., 2:4] * self._leaves_with
        held, step = np.minimum(on[..., 0], on[..., 1]), np.maximum(step[..., 0], step[..., 1])
        most, free = np.maximum(ends[..., 0], ends[..., 1]), 1 - held
        raised = pitched[..., 0] + 1j * pitched[..., 1]
        away = self._flat - raised
        # What is raised turns about what stands.
        shift = (held * away) @ self._beside / np.maximum(held @ self._beside, 1e-9)
        place = pivot + along * (raised + shift + held * (away - shift))
        positions, shares = np.empty((2, *held.shape, 3))
        positions[..., 0], positions[..., 1] = place.real, place.imag
        up = np.maximum((1 - most) * height, free * step)
        positions[..., 2] = free * pitched[..., 2] + up
        shares[..., :2] = (known * np.maximum(held, RAISED_HOLD[0] * most))[..., None]
        near = near_floor(height / self._hip_height)
        shares[..., 2] = held + SWING_HOLD[2] * free * near
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
        flat, ends = [np.zeros(0, dtype=complex)], [np.zeros((0, 2), dtype=bool)]
        for sole in soles:
            points = flat_sole(self._robot, sole) @ (1, 1j)
            flat.append(points - points[-2:].mean())
            ends.append(on_points(sole, np.array([[0.0, 1.0], [1.0, 0.0]])) == 0)
        self._lengths = [-float(points[:2].real.mean()) for points in flat[1:]]
        self._flat, self._leaves_with = np.concatenate(flat), np.concatenate(ends).astype(float)
        self._stays_with = 1 - self._leaves_with
