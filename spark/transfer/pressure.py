"""How far the floor would have to push from beyond a body's feet for it to move as it does.

A body whose weight w moves by a is pushed by the floor at its centre of pressure, which lies at
w - z a / (g + a_z) if it does not tumble (Kajita et al. 2003). Recordings that shake, and bodies
whose masses are not those of a human, have theirs where they have no foot.
"""

import numpy as np
from jaxtyping import Float
from scipy.ndimage import gaussian_filter1d

from spark.blocks import in_blocks
from spark.constants import GRAVITY
from spark.rotation import quat_mul, quat_rotate
from spark.transfer.canonical import CanonicalMotion, canonical_positions

# [s] Standard deviation of a Gaussian: what a recording shakes within less is noise.
NOISE = 1 / 30
_LIGHTEST = 0.3  # of gravity: a body that falls is pushed nowhere
# A sole's point that is higher than the lowest one reaches less far, by so many times as much.
_TAPER = 5.0
_ANGLES = np.linspace(0, 2 * np.pi, 16, endpoint=False)
_DIRECTIONS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1)


def beyond_feet(
    motion: CanonicalMotion, weight: Float[np.ndarray, "T 3"]
) -> Float[np.ndarray, "T"]:
    """How far outside of its soles the centre of pressure lies [hip heights] of a motion whose
    centre of mass takes the path `weight` [m, world]; 0 inside, and for a rig without soles."""
    if not motion.rig.soles:
        return np.zeros(len(motion))
    smooth = gaussian_filter1d(
        acceleration(weight, motion.frame_time),
        NOISE / motion.frame_time,
        axis=0,
        mode="nearest",
    )
    height = np.maximum(weight[:, 2] - motion.floor_z, 0.0)
    pull = np.maximum(GRAVITY + smooth[:, 2], _LIGHTEST * GRAVITY)
    pressure = weight[:, :2] - (height / pull)[:, None] * smooth[:, :2]
    reach = in_blocks(lambda block: _reach(motion.picked(block)), len(motion))
    outside = (pressure @ _DIRECTIONS.T - reach).max(axis=1)
    return np.maximum(outside, 0.0) / motion.rig.hip_height


def acceleration(path: Float[np.ndarray, "T D"], frame_time: float) -> Float[np.ndarray, "T D"]:
    """Second differences; 0 in the first and the last frame."""
    out = np.zeros_like(path)
    out[1:-1] = np.diff(path, 2, axis=0) / frame_time**2
    return out


def _reach(motion: CanonicalMotion) -> Float[np.ndarray, "T 16"]:
    """How far the soles that bear reach in each of `_DIRECTIONS` [m, world]."""
    rig = motion.rig
    joints = np.concatenate([sole.joints for sole in rig.soles])
    offsets = np.concatenate([sole.offsets for sole in rig.soles])
    world = quat_mul(motion.rotations[:, joints], rig.tpose[joints])
    points = canonical_positions(motion, joints.tolist()) + quat_rotate(world, offsets)
    high = points[..., 2:] - points[..., 2:].min(axis=1, keepdims=True)
    return np.asarray((points[..., :2] @ _DIRECTIONS.T - _TAPER * high).max(axis=1))
