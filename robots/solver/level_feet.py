"""Feet that stand: they are level from side to side, on both of their edges.

A skeleton's foot is turned against its rest pose, and how that stood the file does not say to a few
degrees: feet of CMU's walkers, whose legs are apart in the rest pose, roll by 7 degrees wherever
they stand. A person's sole gives way to the floor, and a robot's would stand on an edge.
"""

import numpy as np
from jaxtyping import Bool, Float

from spark.rotation import quat_conj, quat_from_rotvec, quat_mul, quat_rotate

_AHEAD, _LEFT, _UP = np.eye(3)[:, None]  # of a foot in the T-pose


def level_across(
    world: Float[np.ndarray, "T 4"],
    tpose: Float[np.ndarray, "4"],
    flat: Bool[np.ndarray, "T"],
) -> Float[np.ndarray, "T 4"]:
    """The rotations of a foot's joint, `tpose` in the T-pose, rolled by one angle all the while:
    by that which makes the foot level across in half of the frames in which it stands `flat`."""
    if not flat.any():
        return world
    turned = quat_mul(world, quat_conj(tpose))
    left, up = (quat_rotate(turned[flat], axis)[:, 2] for axis in (_LEFT, _UP))
    roll = -np.median(np.arctan2(left, up))
    return quat_mul(quat_mul(turned, quat_from_rotvec(roll * _AHEAD)), tpose)
