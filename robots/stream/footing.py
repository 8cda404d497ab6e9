"""The contacts of a stream's feet, and the robot's footholds.

A foot is held where it comes down. What the source's foot wobbles while it stands is lost, what it
drifts beyond that is motion and stays; as in `robots.solver.footprints`, which sees the whole clip.
A foot in swing is as high as the source's, scaled, and as it is pitched; an end of it that is fast
steps, as there.
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Complex, Float

from robots.solver.foot_path import (
    MAX_UNEVEN,
    RAISED_HOLD,
    STEP_SPEEDS,
    SWING_HOLD,
    near_floor,
    step_height,
)
from robots.solver.footprints import MAX_WOBBLE, flat_sole, on_points
from robots.solver.window_targets import PointTargets
from robots.stream.footprint import Footprint
from robots.stream.frame_targets import FrameReader, FrameTargets
from robots.stream.standing import Standing

HOLD_TIME = 0.1  # [s] over which a foot is taken hold of, and let go


class _Arrived(NamedTuple):
    """A frame of the source: how far its heels and toes have moved over the floor since the one
    before [m, x + iy, scaled], and how far the robot's feet should have turned about the vertical
    [rad]."""

    targets: FrameTargets
    moved: Complex[np.ndarray, "S 2"]
    turned: Float[np.ndarray, "S"]


class _Seen(NamedTuple):
    """Of the feet in one frame: how far heels and toes are held, how high [m] soles are where not,
    and how high heels and toes step, whether it is known where, and their footprints."""

    holds: Float[np.ndarray, "S 2"]
    height: Float[np.ndarray, "S"]
    step: Float[np.ndarray, "S 2"]
    known: Bool[np.ndarray, "S"]
    pivots: tuple[complex, ...]
    headings: tuple[float, ...]


class ContactTracker:
    """The contacts of a stream's feet and the robot's footholds, with a lookahead of `ahead`
    frames."""

    def __init__(self, reader: FrameReader, frame_time: float, ahead: int) -> None:
        self._robot, self._scale = reader.robot, reader.scale
        self._standing = Standing(reader, frame_time)
        self._frame_time, self._ahead = frame_time, ahead
        self._wobble = MAX_WOBBLE * self._robot.rig.hip_height
        self._index_points()
        self._length = self._standing.history + ahead + 1
        self._history: deque[_Arrived] = deque(maxlen=self._length)
        soles = len(self._robot.soles)
        self._planted = np.zeros((soles, 2), dtype=bool)
        self._holds = np.zeros((soles, 2))
        self._ground = np.zeros(soles)
        self._uneven = MAX_UNEVEN * self._robot.rig.hip_height
        self._footprints = [Footprint() for _ in range(soles)]

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
        grip = self._frame_time / HOLD_TIME
        planted, holds, footprints = self._planted, self._holds, self._footprints
        ground, seen = self._ground, []
        frames = [arrived.targets for arrived in self._history]
        for at in range(settled, len(self._history)):
            stood, clearance = planted.any(axis=1), frames[at].clearance
            planted, speed = self._standing.of(frames, at, planted)
            lowest = np.where(stood, np.minimum(ground, clearance), clearance)
            ground = np.where(planted.any(axis=1), lowest, ground)
            self._follow(at, planted, holds, footprints)
            # Where a foot will come down that is still in the air is not known yet.
            known = np.logical_or(holds.any(axis=1), at == settled)
            if at == settled:
                self._put(points, planted, holds)
            holds = holds + np.clip(planted - holds, -grip, 1.0 if first else grip)
            pivots = tuple(footprint.pivot for footprint in footprints)
            headings = tuple(footprint.heading for footprint in footprints)
            height = self._height(clearance, ground, speed)
            step = step_height(speed, self._robot.rig.hip_height)
            seen.append(_Seen(holds, height, step, known, pivots, headings))
            if at == settled:
                self._planted, self._holds, self._ground = planted, holds, ground
                footprints = [replace(footprint) for footprint in footprints]
        return self._targets(np.array([frame.pitched for frame in frames[settled:]]), seen)

    def _arrived(self, now: FrameTargets, last: FrameTargets) -> _Arrived:
        moved = self._scale * ((now.feet - last.feet)[..., :2] @ (1, 1j))
        R = now.world[self._feet] @ last.world[self._feet].transpose(0, 2, 1)
        turned = np.arctan2(R[:, 1, 0] - R[:, 0, 1], R[:, 0, 0] + R[:, 1, 1])
        return _Arrived(now, moved, turned)

    def _put(
        self,
        points: Float[np.ndarray, "P 3"],
        planted: Bool[np.ndarray, "S 2"],
        holds: Float[np.ndarray, "S 2"],
    ) -> None:
        """The footprints of feet that are not held yet, where these are."""
        for s in np.flatnonzero(~holds.any(axis=1)).tolist():
            own = self._sole == s
            length = -float(self._flat[own][:2].real.mean())
            on_toe = bool(planted[s, 1] or not planted[s, 0])
            self._footprints[s].put(points[own], length, on_toe=on_toe)

    def _height(
        self,
        clearance: Float[np.ndarray, "S"],
        ground: Float[np.ndarray, "S"],
        speed: Float[np.ndarray, "S 2"],
    ) -> Float[np.ndarray, "S"]:
        """How high [m] soles are in swing: as the source's, scaled; but where a foot takes no step
        it is put down by what it last stood over the floor."""
        pace = speed[:, 1] / self._robot.rig.hip_height
        slow = np.interp(pace, STEP_SPEEDS[:2], [1.0, 0.0])
        off = np.minimum(np.minimum(ground, self._uneven), np.maximum(clearance, 0.0))
        height: Float[np.ndarray, S] = clearance - slow * off
        return height

    def _follow(
        self,
        at: int,
        planted: Bool[np.ndarray, "S 2"],
        holds: Float[np.ndarray, "S 2"],
        footprints: Sequence[Footprint],
    ) -> None:
        """Takes those along that were held by `holds` in the frame before."""
        _, moved, turned = self._history[at]
        for s in np.flatnonzero(holds.any(axis=1)).tolist():
            point = int(planted[s, 1] or not planted[s, 0])
            footprints[s].follow(
                complex(moved[s, point]), float(turned[s]), float(holds[s].max()), self._wobble
            )

    def _targets(self, pitched: Float[np.ndarray, "T P 3"], seen: Sequence[_Seen]) -> PointTargets:
        """Where the soles' points are held, and how firmly."""
        feet = (np.array(part) for part in zip(*seen, strict=True))
        holds, height, step, known, pivot, heading = (part[:, self._sole] for part in feet)
        on = np.where(self._leaves_with, holds, 1.0)
        held, most = np.minimum(on[..., 0], on[..., 1]), np.maximum(holds[..., 0], holds[..., 1])
        raised = pitched[..., 0] + 1j * pitched[..., 1]
        # What is raised turns about what stands.
        raised += (
            (held * (self._flat - raised)) @ self._beside / np.maximum(held @ self._beside, 1e-9)
        )
        place = pivot + np.exp(1j * heading) * (held * self._flat + (1 - held) * raised)
        positions, shares = np.empty((2, *held.shape, 3))
        positions[..., 0], positions[..., 1] = place.real, place.imag
        step = np.where(self._leaves_with, step, 0.0).max(axis=-1)
        up = np.maximum((1 - most) * height, (1 - held) * step)
        positions[..., 2] = (1 - held) * pitched[..., 2] + up
        shares[..., :2] = (known * np.maximum(held, RAISED_HOLD[0] * most))[..., None]
        near = near_floor(height / self._robot.rig.hip_height)
        shares[..., 2] = held + (1 - held) * near * SWING_HOLD[2]
        return PointTargets(positions, shares)

    def _index_points(self) -> None:
        """Of all points of the soles: which sole's they are, where on the floor from the middle of
        its toes, and with which of heel and toe they leave it."""
        soles = self._robot.soles
        self._feet = [sole.foot for sole in soles]
        self._sole = np.repeat(np.arange(len(soles)), [len(sole) for sole in soles])
        self._beside = (self._sole[:, None] == self._sole).astype(np.float64)
        flat, ends = [np.zeros(0, dtype=complex)], [np.zeros((0, 2), dtype=bool)]
        for sole in soles:
            points = flat_sole(self._robot, sole) @ (1, 1j)
            flat.append(points - points[-2:].mean())
            ends.append(on_points(sole, np.array([[0.0, 1.0], [1.0, 0.0]])) == 0)
        self._flat, self._leaves_with = np.concatenate(flat), np.concatenate(ends)
