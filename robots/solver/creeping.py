"""Which feet carry a body where none is slow enough to stand: recorded feet creep."""

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import uniform_filter1d

from spark.rig.contacts import (
    ADULT_HEIGHT,
    MAX_TILT,
    PLANTED_HEIGHT,
    PLANTED_SPEED,
    above,
    lower_ends,
    speeds,
)

MAX_CREEP = 0.6  # [m/s, of an adult] of a foot that stands because nothing else does
_NEVER = 10.0  # of the speed at which it stands: an end that is no choice


def creeping(
    paths: Float[np.ndarray, "T S 2 3"], height: float, frame_time: float, window: int
) -> Bool[np.ndarray, "T S 2"]:
    """The slowest and lowest heel or toe over a `window` [frames], where it is slow enough; and
    both feet where they go along with it. `height` [m] is the body's standing height."""
    scale = height / ADULT_HEIGHT
    slowness = speeds(paths, frame_time) / (PLANTED_SPEED * scale)
    low = above(paths, height) / (PLANTED_HEIGHT * scale)
    slowness[~lower_ends(paths, height)] = _NEVER
    cost = uniform_filter1d(slowness + low, window, axis=0, mode="nearest")
    best = cost == cost.min(axis=(1, 2), keepdims=True)
    best |= _together(paths, cost, height, frame_time)
    creeps: Bool[np.ndarray, "T S 2"] = best & (slowness < MAX_CREEP / PLANTED_SPEED)
    return creeps


def _together(
    paths: Float[np.ndarray, "T S 2 3"],
    cost: Float[np.ndarray, "T S 2"],
    height: float,
    frame_time: float,
) -> Bool[np.ndarray, "T S 2"]:
    """Ends that are as low as the one that costs least and don't move against it, where all feet
    have one: a body as seen by a camera drifts and bobs, and its feet with it."""
    scale, frames = height / ADULT_HEIGHT, np.arange(len(paths))
    ends = paths.reshape(len(paths), -1, 3)
    one = cost.reshape(len(cost), -1).argmin(axis=1)
    against = speeds(ends[:, :, None] - ends[:, None], frame_time)[frames, one]
    heights = above(paths, height).reshape(len(paths), -1)
    higher = np.abs(heights - heights[frames, one][:, None])
    along = (against < PLANTED_SPEED * scale) & (higher < MAX_TILT * scale)
    along = along.reshape(cost.shape)
    together: Bool[np.ndarray, "T S 2"] = along & along.any(axis=2).all(axis=1)[:, None, None]
    return together
