"""When feet stand: from where something of a sole comes to rest to where the last of it leaves.

A heel is put down while the ankle still moves, and the toes' end rests when the ball has left. So
the ends of the sole tell, and not one joint of the foot; but a foot that turns on its ball stands
while both its ends move. And what bears a body comes to rest and leaves slowly: near a rest it
stands until it moves at a speed at which only swinging feet move.
"""

import numpy as np
from jaxtyping import Bool, Float

from spark.rig.contacts import (
    ADULT_HEIGHT,
    PLANTED_HEIGHT,
    planted_points,
    speeds,
    standing_heights,
)
from spark.runs import true_runs
from spark.transfer.noise import Noise, smoothed

# [s] A shorter stance is a swinging foot that is slow and low for a moment, and between two stances
# no foot is lifted and put down elsewhere in a shorter time.
_MIN_STANCE = 0.1
# [m/s] of an adult: what rested still bears at this speed, or does again. Swinging feet are faster
# than 1 m/s but for a moment.
_BEARING_SPEED = 0.4


def stances(
    ends: Float[np.ndarray, "T F P 3"],
    frame_time: float,
    height: float,
    noise: Noise | None = None,
    balls: Float[np.ndarray, "T F 3"] | None = None,
) -> tuple[Bool[np.ndarray, "F T"], Bool[np.ndarray, "F T"]]:
    """The frames in which each of F feet stands, by the points at the ends of its sole [m, world],
    and those of them in which it stands flat: all of its points rest. Where its ball rests it
    stands, too.

    `height` [m] is the body's standing height. A stance that the motion's start or end cuts short
    may have been longer, and counts. What `noise` the recording had is averaged out.
    """
    count = ends.shape[2]
    if balls is not None:
        ends = np.concatenate([ends, balls[:, :, None]], axis=2)
    if noise is not None:
        ends = noise.slowed(smoothed(ends, noise.contact_cutoff, frame_time))
    size = height / ADULT_HEIGHT
    rests = planted_points(ends, frame_time, height)
    low = ends[..., 2] < standing_heights(ends, height) + PLANTED_HEIGHT * size
    bears = low & (speeds(ends, frame_time) < _BEARING_SPEED * size)
    bears = rests | (bears & (np.arange(bears.shape[2]) < count))
    shortest = round(_MIN_STANCE / frame_time)
    stands = np.zeros(ends.shape[1::-1], dtype=bool)
    for own, rest, bear in zip(stands, np.any(rests, 2).T, np.any(bears, 2).T, strict=True):
        for start, stop in true_runs(bear):
            bear[start:stop] = rest[start:stop].any()
        for start, stop in true_runs(bear, gap=max(shortest - 1, 0)):
            cut = start == 0 or stop == len(bear)
            own[start:stop] = cut or stop - start >= shortest
    return stands, stands & rests.all(axis=2).T
