"""The white noise of a live source, measured and taken away while it comes.

As `spark.transfer.noise`, of the last seconds and by a filter that looks back alone: the Kalman
filter of what goes on as it went and is pushed at random (alpha-beta, Kalata 1984). A filter that
knows nothing of what comes must smooth more, and lags: hence `_SLOWER`. Everything is smoothed
alike, so that feet that stand while hips move still stand.
"""

from collections import deque

import numpy as np
from jaxtyping import Float
from scipy.linalg import solve_discrete_are

from robots.stream.frame_targets import Frame
from spark.rig.contacts import ADULT_HEIGHT
from spark.rig.rig import Rig
from spark.rotation import quat_normalize
from spark.transfer.noise import LEAST_FRAMES, LEAST_NOISE, Noise, white_noise

_MEMORY = 4.0  # [s] of which noise is told
_FIRST = 0.75  # [s] before it is told at all
_PERIOD = 0.2  # [s] after which it is told again
_SLOWER = 0.4  # of the cutoff of a filter that sees the whole clip
_STILL = 0.5  # of the least noise that is taken away, at which it no longer is


class NoiseFilter:
    """Frames of a source on `source`, `frame_time` [s] apart, without their noise, which is
    `expected` to be as it was in an earlier clip."""

    def __init__(self, source: Rig, frame_time: float, expected: Noise | None) -> None:
        self._offsets, self._expected = source.skeleton.offsets, expected
        self._size, self._frame_time = source.standing_height / ADULT_HEIGHT, frame_time
        self._most, self._least = (
            max(LEAST_FRAMES, round(time / frame_time)) for time in (_MEMORY, _FIRST)
        )
        self._period = max(1, round(_PERIOD / frame_time))
        self.reset()

    def reset(self) -> None:
        """Forget what has been seen."""
        self._feet: deque[Float[np.ndarray, "K 3"]] = deque(maxlen=self._most)
        self._frames: deque[Frame] = deque(maxlen=self._most)
        self._unmeasured = 0
        self._filter: _AlphaBeta | None = None
        self.foot_noise = 0.0
        """Of the source's feet [m, its own size], RMS an axis; 0 where it is left as it is."""

    def follow(self, frame: Frame, feet: Float[np.ndarray, "S 2 3"]) -> Frame | None:
        """The newest frame, whose heels and toes are at `feet` [m], without noise; None where
        contacts bear what there is of it."""
        root, rotations, translations = frame
        places = self._offsets if translations is None else np.array(translations)
        whole = Frame(np.array(root), np.array(rotations), places)  # kept: copies
        self._feet.append(feet.reshape(-1, 3))
        self._frames.append(whole)
        self._unmeasured += 1
        if self._expected and len(self._frames) == 1:
            self._take_away(self._expected)
        elif len(self._frames) >= self._least and self._unmeasured >= self._period:
            self._unmeasured = 0
            self._measure()
        if self._filter is None:
            return None
        quiet = self._filter.follow(whole)
        return quiet if translations is not None else quiet._replace(translations=None)

    def _measure(self) -> None:
        """Tell the noise, and begin or end to take it away."""
        feet = white_noise(np.array(self._feet) / self._size) if self._feet[0].size else 0.0
        if feet < LEAST_NOISE * (1.0 if self._filter is None else _STILL):
            self._filter, self.foot_noise = None, 0.0
        else:
            roots = np.array([frame.root_pos for frame in self._frames])
            hips = white_noise(roots[:, None] / self._size)
            self._take_away(Noise(feet, hips, self._frame_time))

    def _take_away(self, noise: Noise) -> None:
        begins = self._filter is None
        self._filter = self._filter or _AlphaBeta(self._frames[0])
        self._filter.tune(_SLOWER * noise.motion_cutoff * self._frame_time)
        for seen in list(self._frames)[:-1] if begins else ():
            self._filter.follow(seen)
        self.foot_noise = noise.feet * self._size


class _AlphaBeta:
    """Frames as they are seen in, frames as they are likely out."""

    def __init__(self, frame: Frame) -> None:
        self._values = _flat(frame, None)
        self._step = np.zeros_like(self._values)

    def tune(self, cutoff: float) -> None:
        """To the gains of the filter whose smoother halves what swings at the cutoff [1/frame]."""
        pushes = (2 * np.sin(np.pi * min(cutoff, 0.5))) ** 4  # variance, of that of the noise
        P = solve_discrete_are(
            np.array([[1.0, 0.0], [1.0, 1.0]]), np.eye(2, 1), np.diag([0.0, pushes]), np.eye(1)
        )
        self._gains = P[:, 0] / (P[0, 0] + 1.0)

    def follow(self, frame: Frame) -> Frame:
        expected = self._values + self._step
        off = _flat(frame, expected) - expected
        self._values = expected + self._gains[0] * off
        self._step = self._step + self._gains[1] * off
        joints = len(frame.rotations)
        root, rotations, places = np.split(self._values, [3, 3 + 4 * joints])
        return Frame(root, quat_normalize(rotations.reshape(-1, 4)), places.reshape(-1, 3))


def _flat(frame: Frame, near: Float[np.ndarray, "D"] | None) -> Float[np.ndarray, "D"]:
    """All numbers of a frame; of the two quaternions of a rotation the one that is near."""
    root, rotations, places = frame
    assert places is not None
    if near is not None:
        known = near[3 : 3 + rotations.size].reshape(-1, 4)
        rotations = np.where((rotations * known).sum(1, keepdims=True) < 0, -rotations, rotations)
    return np.concatenate([root, rotations.ravel(), places.ravel()])
