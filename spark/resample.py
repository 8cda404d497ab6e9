"""Interpolation in time: the one place where anything is looked up between frames or keys.

A time is given as a fractional frame: 2.25 is a quarter of the way from frame 2 to frame 3. The
first and the last frame hold beyond the ends, and a whole frame comes out as it went in.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from spark.blocks import in_blocks
from spark.motion import Motion
from spark.rotation import quat_slerp

# A frame time is written with few digits: 0.0333333, 0.016666, .03333. So much of a clip's length
# they leave open, but no more than the share of a new frame by which its last step may be short.
_ROUNDED = 1.5e-4
_SHORT_STEP = 0.1


def values_at(
    values: Float[np.ndarray, "T *n"], at: Float[np.ndarray, "N"]
) -> Float[np.ndarray, "N *n"]:
    """Positions, angles or other numbers at fractional frames, linearly."""
    return in_blocks(lambda block: _lerp(values, at[block]), len(at))


def rotations_at(
    rotations: Float[np.ndarray, "T *n 4"], at: Float[np.ndarray, "N"]
) -> Float[np.ndarray, "N *n 4"]:
    """Rotations at fractional frames, by slerp along the shorter arc."""
    return in_blocks(lambda block: _slerp(rotations, at[block]), len(at))


def frames_of_keys(
    key_times: Float[np.ndarray, "K"], times: Float[np.ndarray, "N"]
) -> Float[np.ndarray, "N"]:
    """Times [s] as fractional frames of keys that lie at `key_times` [s], in rising order."""
    return np.interp(times, key_times, np.arange(len(key_times)))


def frames_at_rate(count: int, frame_time: float, wanted: float) -> Float[np.ndarray, "N"]:
    """`count` frames of `frame_time` [s] looked up every `wanted` seconds: the first frame stays,
    and no time beyond the last is asked for. A time that misses the last frame by no more than its
    frame time is rounded is that frame's."""
    last = (count - 1) * frame_time / wanted
    rounded = max(1e-6, min(_ROUNDED * last, _SHORT_STEP))
    at = np.arange(int(last + rounded) + 1) * (wanted / frame_time)
    near = np.round(at)
    # So close to a frame is what dividing leaves.
    at = np.where(np.abs(at - near) < 1e-6, near, at)
    return np.minimum(at, count - 1)


def motion_at(motion: Motion, at: Float[np.ndarray, "N"], frame_time: float) -> Motion:
    """A motion at fractional frames that lie `frame_time` [s] apart."""
    moving = motion.translations
    return replace(
        motion,
        frame_time=frame_time,
        root_pos=values_at(motion.root_pos, at),
        rotations=rotations_at(motion.rotations, at),
        translations=None if moving is None else values_at(moving, at),
    )


def _lerp(
    values: Float[np.ndarray, "T *n"], at: Float[np.ndarray, "N"]
) -> Float[np.ndarray, "N *n"]:
    before, after, fraction = _neighbours(at, len(values))
    fraction = fraction.reshape(-1, *(1,) * (values.ndim - 1))
    return (1 - fraction) * values[before] + fraction * values[after]


def _slerp(
    rotations: Float[np.ndarray, "T *n 4"], at: Float[np.ndarray, "N"]
) -> Float[np.ndarray, "N *n 4"]:
    before, after, fraction = _neighbours(at, len(rotations))
    fraction = fraction.reshape(-1, *(1,) * (rotations.ndim - 2))
    fraction = np.broadcast_to(fraction, (len(fraction), *rotations.shape[1:-1]))
    return quat_slerp(rotations[before], rotations[after], fraction)


def _neighbours(
    at: Float[np.ndarray, "N"], count: int
) -> tuple[Int[np.ndarray, "N"], Int[np.ndarray, "N"], Float[np.ndarray, "N"]]:
    """The frames before and after, and the fraction of the way from the one to the other."""
    at = np.clip(at, 0, count - 1)
    before = np.minimum(at.astype(int), max(count - 2, 0))
    return before, np.minimum(before + 1, count - 1), at - before
