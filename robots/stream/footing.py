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
from robots.stream.foot import CLIMB_SPEED, Foot, settling
from robots.stream.frame_targets import LATENCY, FrameReader, FrameTargets
from robots.stream.standing import SourceFeet, Standing

HOLD_TIME = 0.1  # [s] over which a foot is taken hold of, and let go
_LIFT = 1.1  # times as high as in clips is a step that is asked for: smoothness costs some


class _Arrived(NamedTuple):
    """A frame of the source: how high the robot's soles should be and where their points from each
    other, how far each foot's heel and toes have moved over the floor since the frame before [m,
    x + iy, scaled], and how far the robot's feet should have turned about the vertical [rad]."""

    clearance: list[float]
    pitched: Float[np.ndarray, "P 3"]
    moved: list[tuple[complex, complex]]
    turned: list[float]


class ContactTracker:
    """The contacts of a stream's feet and the robot's footholds, with a lookahead of `LATENCY`
    frames."""

    def __init__(self, reader: FrameReader, frame_time: float) -> None:
        # Plain numbers: numpy's take three times as long.
        self._robot, self._scale = reader.robot, float(reader.scale)
        self._standing = Standing(reader, frame_time)
        self._grip = frame_time / HOLD_TIME
        self._settles = settling(frame_time)
        hip_height = float(self._robot.rig.hip_height)
        self._climbs = CLIMB_SPEED * hip_height * frame_time
        self._hip_height, self._wobble = hip_height, MAX_WOBBLE * hip_height
        self._uneven = MAX_UNEVEN * hip_height
        self._index_points()
        self._arrived: deque[_Arrived] = deque(maxlen=LATENCY + 1)
        self._source: deque[SourceFeet] = deque(maxlen=self._standing.history + LATENCY + 1)
        self.ground: Float[np.ndarray, "T P"] = np.zeros((LATENCY + 1, len(self._foot)))
        """Of the last frames, how high [m] what each of the soles' points stands on is."""
        self._last_axes: Complex[np.ndarray, "S 3"]
        self._feet = [Foot() for _ in self._robot.soles]
        self._fresh = True

    def begin(self, first: FrameTargets, later: FrameTargets, frames: int) -> None:
        """Before its first frame, which comes next, the source has moved evenly: as from that to
        a `later` one, so many frames on. If that is the first one, too, it has stood still."""
        own, then = self._standing.feet(first), self._standing.feet(later)
        axes, later_axes = self._axes_over_floor(first), self._axes_over_floor(later)
        turned = [
            cmath.phase(np.vdot(before, now)) / frames
            for before, now in zip(axes, later_axes, strict=True)
        ]
        before = [
            own.before(then, k / frames)
            for k in range(self._standing.history + LATENCY + 1, -1, -1)
        ]
        moved = self._moved(before[-2], own)
        arrived = _Arrived(first.clearance.tolist(), first.pitched, moved, turned)
        self._arrived.extend([arrived] * (LATENCY + 1))
        self._source.extend(before[:-1])
        self._last_axes = axes * np.exp(-1j * np.array(turned))[:, None]

    def update(
        self, targets: FrameTargets, points: Float[np.ndarray, "P 3"], noise: float = 0.0
    ) -> PointTargets:
        """Takes in the newest frame, and says how the feet stand in it and the `LATENCY` before it;
        the points of the robot's soles are at `points` in the first of these. How they stand in
        that one is settled then; of the later ones it is what can be seen so far. The source's feet
        came with so much noise [m, RMS an axis]."""
        tightens = 1.0 if self._fresh else self._grip
        self._fresh = False
        self._standing.listen(noise)
        self._take_in(targets)
        frames = list(self._source)
        settled = len(frames) - 1 - LATENCY
        motion = [self._standing.motion(frames, at) for at in range(settled, len(frames))]
        speeds = self._scale * np.array([speeds for speeds, _ in motion])
        steps = (_LIFT * step_height(speeds, self._hip_height)).tolist()
        feet, numbers = self._feet, list[float]()
        own = [float(points[sole, 2].min()) for sole in self._points]
        places: list[complex] = []
        for at, (arrived, (speed, height), step) in enumerate(
            zip(self._arrived, motion, steps, strict=True), settled
        ):
            stood = [foot.planted for foot in feet]
            ground = self._standing.below(height, [foot.top for foot in feet])
            stands = self._standing.of(frames, at, stood, speed, height, ground)
            for s, foot in enumerate(feet):
                if True in stands[s]:
                    foot.stand_on(
                        ground[s], arrived.clearance[s], own[s], self._settles, self._climbs
                    )
                top = foot.rise if ground[s] == foot.top else self._scale * ground[s]
                clearance = arrived.clearance[s] - top
                moved, turned = arrived.moved[s], arrived.turned[s]
                foot.move_on(stands[s], clearance, moved, turned, self._wobble)
                # Where a foot will come down that is still in the air is not known yet.
                known = foot.is_held or at == settled
                if at == settled and not foot.is_held:
                    here = [complex(x, y) for x, y, _ in points[self._points[s]].tolist()]
                    foot.footprint.put(here, self._lengths[s], on_toe=foot.on_toe)
                foot.grip(self._grip, tightens)
                pace = self._scale * speed[s][1] / self._hip_height
                up = foot.height(clearance, pace, self._uneven)
                (heel, toes), (heel_free, toes_free) = foot.holds, foot.freedom
                heel_step, toe_step = step[s]
                # The ball leaves the floor with either end.
                numbers += (heel, min(heel, toes), toes)
                ball_step = max(heel_step, toe_step) * max(heel_free, toes_free)
                numbers += (heel_step * heel_free, ball_step, toe_step * toes_free)
                numbers += (up, float(known), top)
                places += (foot.footprint.pivot, cmath.rect(1.0, foot.footprint.heading))
            if at == settled:
                feet = [foot.copy() for foot in feet]
        return self._targets(
            np.array([arrived.pitched for arrived in self._arrived]),
            np.array(numbers).reshape(-1, 9).T,
            np.array(places, dtype=complex).reshape(-1, 2).T,
        )

    def _take_in(self, targets: FrameTargets) -> None:
        """The newest frame."""
        own, axes = self._standing.feet(targets), self._axes_over_floor(targets)
        moved = self._moved(self._source[-1], own)
        turns = zip(self._last_axes, axes, strict=True)
        turned = [cmath.phase(np.vdot(before, now)) for before, now in turns]
        self._arrived.append(_Arrived(targets.clearance.tolist(), targets.pitched, moved, turned))
        self._source.append(own)
        self._last_axes = axes

    def _moved(self, last: SourceFeet, own: SourceFeet) -> list[tuple[complex, complex]]:
        """How far heels and toes have moved [m, x + iy, scaled]."""
        return [
            (self._scale * (heel - last_heel), self._scale * (toe - last_toe))
            for (heel, toe), (last_heel, last_toe) in zip(own.places, last.places, strict=True)
        ]

    def _axes_over_floor(self, targets: FrameTargets) -> Complex[np.ndarray, "S 3"]:
        """The axes of the robot's feet, seen from above: x + iy. Of a turn between two such triples
        about the vertical their product says the angle."""
        world = targets.world.take(self._foot_joints, axis=0)
        axes: Complex[np.ndarray, "S 3"] = world[:, 0] + 1j * world[:, 1]
        return axes

    def _targets(
        self,
        pitched: Float[np.ndarray, "T P 3"],
        feet: Float[np.ndarray, "9 F"],
        places: Complex[np.ndarray, "2 F"],
    ) -> PointTargets:
        """Where the soles' points are held, and how firmly. Of each foot in each frame there are,
        in `feet`, how far its heel, ball and toes are held, and how high they step [m], how high
        the sole is where not held [m], whether it is known where, and how high the ground is [m];
        in `places` the middle of its toes [m, x + iy], and a unit along it."""
        held, step, up, known, top = feet[:3], feet[3:6], feet[6], feet[7], feet[8]
        most, free = np.maximum(held[0], held[2]), 1 - held
        ends = np.empty((4, *held.shape))
        ends[0] = held
        np.maximum((1 - most) * up, step, out=ends[1])
        ends[1] += top
        self.ground = (most * top).take(self._foot)
        np.multiply(known, np.maximum(held, RAISED_HOLD[0] * most), out=ends[2])
        np.add(held, SWING_HOLD[2] * near_floor(up / self._hip_height) * free, out=ends[3])
        hold, low, along_floor, in_height = ends.reshape(4, -1).take(self._end, axis=1)
        pivot, along = places.take(self._foot, axis=1)
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
        """Of all points of the soles: where on the floor they are from the middle of the toes; and
        in all frames, among all feet, which foot's and which end's they are."""
        soles = self._robot.soles
        self._foot_joints = np.array([sole.foot for sole in soles], dtype=int)
        counts = [len(sole) for sole in soles]
        stops = np.cumsum(counts, dtype=int).tolist()
        self._points = [slice(n - count, n) for n, count in zip(stops, counts, strict=True)]
        sole_of = np.repeat(np.arange(len(soles)), counts)
        self._beside = (sole_of[:, None] == sole_of).astype(np.float64)
        flat, ends = [np.zeros(0, dtype=complex)], [np.zeros(0, dtype=int)]
        for sole in soles:
            points = flat_sole(self._robot, sole) @ (1, 1j)
            flat.append(points - points[-2:].mean())
            heel, toes = on_points(sole, np.eye(2)).T
            ends.append(1 + (toes - heel).astype(int))
        self._lengths = [-float(points[:2].real.mean()) for points in flat[1:]]
        self._flat = np.concatenate(flat)
        self._foot = len(soles) * np.arange(LATENCY + 1)[:, None] + sole_of
        self._end = len(soles) * (LATENCY + 1) * np.concatenate(ends) + self._foot
