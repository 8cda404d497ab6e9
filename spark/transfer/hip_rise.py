"""Hips that rise with what their legs stand on and hang from, and come down as these are spread.

The height of the hips' middle over the floor is a sum along the leg that bears the body: how high
its sole is, the ankle over the lowest point of the sole, the hip joint over the ankle, and the
middle over the hip joint. A path that is scaled as a whole scales each of them. But the rotations
of foot and pelvis are copied: on its toes a body of large feet stands higher, and a tilt lowers the
hip joints of a broad pelvis further. And a longer step spreads a leg further, whose hip joint is
lower then. What the two bodies differ by would be taken from the leg: a knee would bend where the
source's is straight, or a foot would not reach its print. So it is added to the hips' height.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.ndimage import gaussian_filter1d

from spark.rig.roles import LIMBS, Group
from spark.rotation import quat_mul, quat_rotate
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.leg_fit import from_sole

# [hip heights] A foot whose sole is this high bears half as much as one that stands.
_LIGHT = 0.05
# [s] Within which the hips rise and come down, the standard deviation of a Gaussian: the floor has
# to give what a shorter time would ask for.
_EASE = 0.15


class Standing(NamedTuple):
    """The hip joint and the ankle of one leg, where they are, and where the points of its sole are
    [m, world]."""

    joints: tuple[int, int]
    ends: Float[np.ndarray, "T 2 3"]
    sole: Float[np.ndarray, "T P 3"]

    def at(self, frames: Int[np.ndarray, "N"]) -> "Standing":
        """In some frames."""
        return self._replace(ends=self.ends[frames], sole=self.sole[frames])


def standing(motion: CanonicalMotion, group: Group) -> Standing:
    """A leg's ends and its sole. Raises `SkeletonError` where the rig has no such foot."""
    rig = motion.rig
    hip, _, ankle, _ = LIMBS[group]
    ends = rig.roles.require(hip), rig.roles.require(ankle)
    sole = next(sole for sole in rig.soles if sole.side == group.side)
    positions = canonical_positions(motion, [*ends, *sole.joints.tolist()])
    world = quat_mul(motion.rotations[:, sole.joints], rig.tpose[sole.joints])
    points = positions[:, 2:] + quat_rotate(world, sole.offsets)
    return Standing(ends, positions[:, :2], points)


def hip_rise(
    source: CanonicalMotion,
    moved: CanonicalMotion,
    legs: Sequence[tuple[Standing, Standing]],
    low: Float[np.ndarray, "L T"],
) -> Float[np.ndarray, "T"]:
    """How much higher [m] the hips of `moved`, the transfer of `source`, are for what foot, leg and
    pelvis are more than the source's, scaled; `legs` are the same ones on both.

    Each leg counts by how `low` the source's sole is over the ground [hip heights], and of its rise
    as much is made as it is upright, from 0 (level, as on the ground) to 1: sum(w u rise) / sum(w).
    """
    scale = moved.rig.hip_height / source.rig.hip_height
    rises = [
        _beside_leg(moved, own)
        - scale * _beside_leg(source, theirs)
        + _along_leg(moved, own, source, theirs)
        for theirs, own in legs
    ]
    upright = [_upright(source, theirs) for theirs, _ in legs]
    return hips_with_feet(np.multiply(upright, rises), low, moved.frame_time)


def lowest(leg: Standing, motion: CanonicalMotion) -> Float[np.ndarray, "T"]:
    """The height over the floor of the lowest point of a sole [hip heights]."""
    return np.asarray(leg.sole[..., 2].min(axis=1) - motion.floor_z) / motion.rig.hip_height


def hips_with_feet(
    moves: Float[np.ndarray, "L T"], low: Float[np.ndarray, "L T"], frame_time: float
) -> Float[np.ndarray, "T"]:
    """How the hips move with what moves at each of L legs, whose soles are so `low` [hip heights]:
    the lower, the more a leg counts, and no faster than the floor would give."""
    weights = 1 / (1 + (np.maximum(low, 0) / _LIGHT) ** 2)
    mean = (weights * moves).sum(axis=0) / weights.sum(axis=0)
    return np.asarray(gaussian_filter1d(mean, _EASE / frame_time, mode="nearest"))


def _beside_leg(motion: CanonicalMotion, leg: Standing) -> Float[np.ndarray, "T"]:
    """By how much foot and pelvis make the hips' middle higher than in the T-pose [m]."""
    hip, ankle = leg.ends[..., 2].T
    pelvis, foot = motion.hips[:, 2] - hip, ankle - leg.sole[..., 2].min(axis=1)
    return np.asarray(pelvis + foot - from_sole(motion.rig, leg.joints[1])[2])


def _along_leg(
    moved: CanonicalMotion, own: Standing, source: CanonicalMotion, theirs: Standing
) -> Float[np.ndarray, "T"]:
    """How much higher [m] the hip joint of `own` is over its ankle than the source's, scaled.

    The leg is shorter than in the T-pose by as many hip heights as the source's is, and its ends
    are as far apart over the ground as they are: height = sqrt(length² - across²).
    """
    scale = moved.rig.hip_height / source.rig.hip_height
    rest, their_rest = _bones_in_tpose(moved, own), _bones_in_tpose(source, theirs)
    leg, their_leg = (each.ends[:, 0] - each.ends[:, 1] for each in (own, theirs))
    shortened = np.linalg.norm(their_rest) - np.linalg.norm(their_leg, axis=1)
    length = np.maximum(np.linalg.norm(rest) - scale * shortened, 0.0)
    height = np.sqrt(np.maximum(length**2 - (leg[:, :2] ** 2).sum(axis=1), 0.0))
    return np.asarray(height - rest[2] - scale * (their_leg[:, 2] - their_rest[2]))


def _bones_in_tpose(motion: CanonicalMotion, leg: Standing) -> Float[np.ndarray, "3"]:
    """From the ankle to the hip joint [m]."""
    hip, ankle = motion.rig.tpose_positions[list(leg.joints)]
    return np.asarray(hip - ankle)


def _upright(motion: CanonicalMotion, leg: Standing) -> Float[np.ndarray, "T"]:
    """How far the hip joint is above the ankle, over how far it is in the T-pose; 0 to 1. A leg
    without length is not upright."""
    above = leg.ends[:, 0, 2] - leg.ends[:, 1, 2]
    return np.clip(above / max(_bones_in_tpose(motion, leg)[2], 1e-9), 0.0, 1.0)
