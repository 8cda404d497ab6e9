"""Recordings, and windows cut out of them, as they are or slowed down and sped up."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from spark.network.features import BodyFeatures
from spark.rotation import quat_slerp
from spark.training.staging import foot_lift

_FEW = 4  # windows at another pace that are turned at once: more leave the processor's cache


@dataclass(frozen=True, eq=False)
class TrainingClip:
    """A recording in canonical form on the network's view of its own body, at 30 fps.

    `rotations` are world rotations since the T-pose, `hips` the hips' path over the floor in hip
    heights, `planted` whether the left and the right foot stand.
    """

    name: str
    body: BodyFeatures
    rotations: Float[np.ndarray, "T K 4"]
    hips: Float[np.ndarray, "T 3"]
    planted: Bool[np.ndarray, "T 2"]
    frame_time: float

    @cached_property
    def lift(self) -> Float[np.ndarray, "T 2 2"]:
        """How much higher ankle and toe of each foot are than in the T-pose [hip heights]."""
        rotations, hips = (np.asarray(x, np.float64) for x in (self.rotations, self.hips))
        return foot_lift(self.body, rotations, hips).astype(np.float32)

    @cached_property
    def ground(self) -> Float[np.ndarray, "T 9"]:
        """Path, flags and lifts side by side, to be read at once."""
        parts = (self.hips, self.planted, self.lift.reshape(-1, 4))
        return np.concatenate(parts, axis=1, dtype=np.float32)


class Cut(NamedTuple):
    """The window of `clip` that begins at frame `at`, at `speed` times its pace."""

    clip: TrainingClip
    at: int
    speed: float = 1.0


class Ground(NamedTuple):
    """What the feet need to know of windows: the hips' path, which feet stand, how much higher
    ankle and toe of each are than in the T-pose."""

    hips: Float[np.ndarray, "*n T 3"]
    planted: Bool[np.ndarray, "*n T 2"]
    lift: Float[np.ndarray, "*n T 2 2"]

    def of_draws(self, windows: int) -> "Ground":
        """The same, each draw's windows apart."""
        return Ground(*(each.reshape(-1, windows, *each.shape[1:]) for each in self))


class Frames(NamedTuple):
    """For each frame of N windows, counted from a window's first: the frames of the clip before and
    after it, how far it is from the one to the other, and the nearest."""

    before: Int[np.ndarray, "N T"]
    after: Int[np.ndarray, "N T"]
    share: Float[np.ndarray, "N T"]
    nearest: Int[np.ndarray, "N T"]


def frames_of(cuts: Sequence[Cut], frames: int) -> Frames:
    """Of windows of so many frames."""
    speeds = np.array([[cut.speed] for cut in cuts])
    times, last = np.arange(frames) * speeds, np.ceil((frames - 1) * speeds).astype(int)
    before = times.astype(int)
    nearest = np.minimum(times.round().astype(int), last)
    return Frames(
        before, np.minimum(before + 1, last), (times - before).astype(np.float32), nearest
    )


def ground_of(cuts: Sequence[Cut], frames: Frames) -> Ground:
    """Of these windows. Between frames paths are interpolated, and flags and heights are those of
    the nearest."""
    N, T = frames.nearest.shape
    near, before, after = np.empty((3, N, T, 9), np.float32)
    for n, (clip, at, speed) in enumerate(cuts):
        if speed == 1:
            near[n] = before[n] = after[n] = clip.ground[at : at + T]
            continue
        ground = clip.ground[at:]
        for out, of_frames in ((near, frames.nearest), (before, frames.before)):
            ground.take(of_frames[n], 0, out[n], "clip")
        ground.take(frames.after[n], 0, after[n], "clip")
    hips = before[..., :3] + frames.share[..., None] * (after[..., :3] - before[..., :3])
    return Ground(hips, near[..., 3:5] > 0.5, near[..., 5:].reshape(N, T, 2, 2))


def cut_rotations(
    cuts: Sequence[Cut], frames: Frames, places: Sequence[Float[np.ndarray, "K T 4"]]
) -> None:
    """Write each window's rotations into its place, in planes."""
    others = []
    for n, (cut, place) in enumerate(zip(cuts, places, strict=True)):
        # A view of a memory-mapped array costs more than what is read through it.
        rotations = np.asarray(cut.clip.rotations)[cut.at :]
        if cut.speed == 1:
            place[:] = rotations[: place.shape[1]].swapaxes(0, 1)
        else:
            others.append((n, place, rotations))
    for few in (others[k : k + _FEW] for k in range(0, len(others), _FEW)):
        now, later = (
            _planes([rotations[of_frames[n]] for n, _, rotations in few])
            for of_frames in (frames.before, frames.after)
        )
        shares = np.concatenate([frames.share[n].repeat(len(place)) for n, place, _ in few])
        turned, end = quat_slerp(now, later, shares), 0
        for _, place, _ in few:
            joints, T = place.shape[:2]
            start, end = end, end + joints * T
            place[:] = turned[start:end].reshape(T, joints, 4).swapaxes(0, 1)


def _planes(parts: Sequence[Float[np.ndarray, "T K 4"]]) -> Float[np.ndarray, "M 4"]:
    flat = np.concatenate([part.reshape(-1, 4) for part in parts])
    return np.ascontiguousarray(flat.T).T
