"""Hips that rise with what their legs stand on and hang from.

The height of the hips' middle over the floor is a sum along the leg that bears the body: how high
its sole is, the ankle over the lowest point of the sole, the hip joint over the ankle, and the
middle over the hip joint. A path that is scaled as a whole scales foot and pelvis, too. But the
rotations are copied: on its toes a body of large feet stands higher, and a tilt lowers the hip
joints of a broad pelvis further. What the two differ by would be taken from the leg, and a knee
would bend where the source's is straight. So it is added to the hips' height.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from spark.transfer.canonical import CanonicalMotion
from spark.transfer.leg_fit import from_sole

# [hip heights] A foot whose sole is this high bears half as much as one that stands.
_LIGHT = 0.05
# [s] Within which the hips rise and come down, the standard deviation of a Gaussian: the floor has
# to give what a shorter time would ask for.
_EASE = 0.15


class Standing(NamedTuple):
    """The hip joint and the ankle of one leg, how high they are, and where the points of its sole
    are [m, world]."""

    joints: tuple[int, int]
    heights: Float[np.ndarray, "T 2"]
    sole: Float[np.ndarray, "T P 3"]


def hip_rise(
    source: CanonicalMotion,
    moved: CanonicalMotion,
    legs: Sequence[tuple[Standing, Standing]],
) -> Float[np.ndarray, "T"]:
    """How much higher [m] the hips of `moved`, the transfer of `source`, are for what foot and
    pelvis are more than the source's, scaled; `legs` are the same ones on both.

    Each leg counts by how low the source's sole is, and of its rise as much is made as it is
    upright, from 0 (level, as on the ground) to 1: sum(w u rise) / sum(w).
    """
    scale = moved.rig.hip_height / source.rig.hip_height
    rises = [_beside_leg(moved, own) - scale * _beside_leg(source, theirs) for theirs, own in legs]
    upright = [_upright(source, theirs) for theirs, _ in legs]
    low = np.stack([theirs.sole[..., 2].min(axis=1) for theirs, _ in legs]) - source.floor_z
    weights = 1 / (1 + (np.maximum(low, 0) / (_LIGHT * source.rig.hip_height)) ** 2)
    rise = (weights * upright * rises).sum(axis=0) / weights.sum(axis=0)
    return np.asarray(gaussian_filter1d(rise, _EASE / moved.frame_time, mode="nearest"))


def _beside_leg(motion: CanonicalMotion, leg: Standing) -> Float[np.ndarray, "T"]:
    """By how much foot and pelvis make the hips' middle higher than in the T-pose [m]."""
    hip, ankle = leg.heights.T
    pelvis, foot = motion.hips[:, 2] - hip, ankle - leg.sole[..., 2].min(axis=1)
    return np.asarray(pelvis + foot - from_sole(motion.rig, leg.joints[1])[2])


def _upright(motion: CanonicalMotion, leg: Standing) -> Float[np.ndarray, "T"]:
    """How far the hip joint is above the ankle, over how far it is in the T-pose; 0 to 1. A leg
    without length is not upright."""
    hip, ankle = motion.rig.tpose_positions[list(leg.joints), 2]
    above = leg.heights[:, 0] - leg.heights[:, 1]
    return np.clip(above / max(hip - ankle, 1e-9), 0.0, 1.0)
