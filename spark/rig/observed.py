"""What a motion shows of the rig under it, asked where the rest pose of a file is none."""

from collections.abc import Mapping
from itertools import product

import numpy as np
from jaxtyping import Bool, Float, Int

from spark.motion import Motion
from spark.rotation import (
    quat_angle,
    quat_continuous,
    quat_identity,
    quat_mul,
    quat_normalize,
    quat_rotate,
)

# A joint that bends less than 25 degrees throughout does not show which way it bends.
_MIN_BEND_SINE = np.sin(np.radians(25))

# The 24 turns of a cube: motion capture systems build rigs with joint axes at right angles.
_RIGHT_ANGLES = quat_normalize(
    np.array(
        [
            q
            for q in product((-1.0, 0.0, 1.0), repeat=4)
            if q > (0, 0, 0, 0) and np.count_nonzero(q) in (1, 2, 4)
        ]
    )
)


def mean_rotations(
    rotations: Float[np.ndarray, "T *n 4"], weights: Float[np.ndarray, "T"]
) -> Float[np.ndarray, "*n 4"]:
    """The mean over time, blind to the signs of quaternions (Markley et al. 2007)."""
    moments = np.einsum("t,t...i,t...k->...ik", weights, rotations, rotations)
    return np.linalg.eigh(moments)[1][..., -1]


def nearest_right_angle(q: Float[np.ndarray, "*n 4"]) -> Float[np.ndarray, "*n 4"]:
    """The turn by right angles that is nearest to each rotation."""
    return _RIGHT_ANGLES[np.abs(q @ _RIGHT_ANGLES.T).argmax(-1)]


def bend_axis(
    motion: Motion,
    upper: int,
    lower: int,
    upper_bone: Float[np.ndarray, "3"],
    lower_bone: Float[np.ndarray, "3"],
) -> Float[np.ndarray, "3"] | None:
    """The unit axis, in `upper`'s own axes, about which `lower` bends; None where it hardly does.

    Bones are vectors in their own joint's axes. Only their directions are looked at: what a joint
    twists about its bone does not count.
    """
    between = _chain(motion, lower)[_chain(motion, upper).size :]
    turned = quat_rotate(_rotations_along(motion, between), lower_bone)
    length = np.linalg.norm(upper_bone) * np.linalg.norm(lower_bone)
    sines = np.cross(upper_bone, turned) / length
    axis = np.linalg.eigh(sines.T @ sines)[1][:, -1]
    along = sines @ axis
    if np.percentile(np.abs(along), 95) < _MIN_BEND_SINE:
        return None
    # Deep bends tell the sign: a knee may be stretched a little beyond straight.
    return axis if (along * np.abs(along)).sum() > 0 else -axis


def resting_slope(
    motion: Motion, foot: int, bone: Float[np.ndarray, "3"], shank: Float[np.ndarray, "3"]
) -> float | None:
    """The angle [rad] of a foot over the floor below an upright shank, where the ankle is at rest.

    `shank` is the bone above, in its own axes. None unless the ankle keeps still for most of the
    time that the leg moves: many systems do not capture it, and leave it as the rig was built.
    """
    rest, still = _resting(motion.rotations[:, foot])
    _, stiff = _resting(motion.rotations[:, int(motion.skeleton.parents[foot])])
    if still < 0.5 or stiff > 0.5:
        return None
    down = quat_rotate(rest, bone) @ shank / (np.linalg.norm(bone) * np.linalg.norm(shank))
    return -float(np.arcsin(np.clip(down, -1.0, 1.0)))


def _resting(q: Float[np.ndarray, "T 4"]) -> tuple[Float[np.ndarray, "4"], float]:
    """The median rotation, and for which part of the frames it holds within a degree."""
    median = quat_normalize(np.median(quat_continuous(q), axis=0))
    return median, float(np.mean(quat_angle(q, median) < np.radians(1)))


def standing_slope(
    motion: Motion,
    feet: Mapping[int, Float[np.ndarray, "3"]],
    among: Bool[np.ndarray, "T"] | None = None,
) -> float:
    """The angle [rad] of the feet over the floor where they stand: low and slow, `among` some
    frames at least.

    `feet` holds each foot's bone, in the axes of its joint; both are taken to be alike.
    """
    heights, speeds, slopes = [], [], []
    for foot, bone in feet.items():
        position, world = _path(motion, foot)
        along = quat_rotate(world, bone)
        heights.append(position[:, 2])
        speeds.append(_speed(position))
        slopes.append(np.arctan2(along[:, 2], np.linalg.norm(along[:, :2], axis=-1)))
    height, speed, slope = (
        np.concatenate([each if among is None else each[among] for each in x])
        for x in (heights, speeds, slopes)
    )
    low = height <= np.percentile(height, 30)
    return float(np.median(slope[low & (speed <= np.median(speed[low]))]))


def _path(motion: Motion, joint: int) -> tuple[Float[np.ndarray, "T 3"], Float[np.ndarray, "T 4"]]:
    """World position [m] and rotation of one joint."""
    world, position = quat_identity(motion.root_pos[:, :1]), np.zeros_like(motion.root_pos)
    for j in _chain(motion, joint):
        local = motion.skeleton.offsets[j] if j else motion.root_pos
        if j and motion.translations is not None:
            local = motion.translations[:, j]
        position = position + quat_rotate(world, local)
        world = quat_mul(world, motion.rotations[:, j])
    return position, world


def _speed(position: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T"]:
    """How far a point moves from frame to frame [m]."""
    if len(position) < 2:
        return np.zeros(len(position))
    return np.linalg.norm(np.gradient(position, axis=0), axis=-1)


def _chain(motion: Motion, joint: int) -> Int[np.ndarray, "_"]:
    """The joints from the root down to `joint`."""
    return np.array(motion.skeleton.ancestors(joint)[::-1])


def _rotations_along(motion: Motion, joints: Int[np.ndarray, "_"]) -> Float[np.ndarray, "T 4"]:
    q = quat_identity(motion.root_pos[:, :1])
    for j in joints:
        q = quat_mul(q, motion.rotations[:, j])
    return q
