"""Feet that turn up at the ankle where they would be in the floor.

A foot that is seen to point into the floor, or whose leg does not lift it at once, is turned about
a level axis across it, no further than until neither its toes nor its heel are too low. So the knee
has nothing to do with it.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from spark.rig.roles import LIMBS, Group
from spark.rotation import quat_from_rotvec, quat_mul, quat_rotate
from spark.smoothstep import smoothstep
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.hip_rise import standing
from spark.transfer.reach import in_time

_LEVER = 0.4  # of the way from the ankle to the lowest point, that is level: less turns less
_EASE = 0.05  # [s] before the foot has to be turned it begins to: toes dip for a single frame
_MOST = 0.6  # [rad] 34 degrees: the foot of who lies on the floor is not turned over


def turn_up(
    motion: CanonicalMotion, group: Group, least: Float[np.ndarray, "T"]
) -> Float[np.ndarray, "T 4"]:
    """By which a foot is turned, in world axes, so that no point of its sole is lower than `least`
    [m, world], but for `_MOST`, and less where it hangs; where it is too low as a whole, so that
    its heel and its toes are about as low."""
    leg = standing(motion, group)
    points = leg.sole - leg.ends[:, 1:]
    left = quat_rotate(motion.rotations[:, leg.joints[1]], np.array([0.0, 1.0, 0.0]))
    left[:, 2] = 0.0
    left /= np.maximum(np.linalg.norm(left, axis=1, keepdims=True), 1e-9)
    ahead = np.einsum("tpx,tx->tp", points[..., :2], left[:, 1::-1] * np.array([1.0, -1.0]))
    up = points[..., 2]
    # By how much the toes have to be turned up at least, and the heel allows them to be at most.
    away = np.maximum(np.hypot(ahead, up), 1e-9)
    free = np.arcsin(np.clip((least - leg.ends[:, 1, 2])[:, None] / away, -1.0, 1.0))
    at = np.arctan2(up, abs(ahead))
    toes = np.where(ahead > 0, free - at, -np.pi).max(axis=1)
    heel = np.where(ahead < 0, at - free, np.pi).min(axis=1)
    front, back = np.maximum(ahead.max(axis=1), 0.0), np.maximum(-ahead.min(axis=1), 0.0)
    level = (front * toes + back * heel) / np.maximum(front + back, 1e-9)
    angle = np.clip(np.where(toes > heel, level, np.clip(0.0, toes, heel)), -_MOST, _MOST)
    # The lowest point of a foot that hangs would go far to rise little.
    lever = np.take_along_axis(np.abs(ahead) / away, up.argmin(axis=1)[:, None], axis=1)[:, 0]
    angle *= smoothstep(lever / _LEVER)
    # Begun in time, as far as the other end of the sole is free to.
    up, down = (in_time(np.maximum(way * angle, 0.0), _EASE, motion.frame_time) for way in (1, -1))
    angle = np.clip(
        up - down, np.minimum(angle, np.minimum(toes, 0)), np.maximum(angle, np.maximum(heel, 0))
    )
    return quat_from_rotvec(-angle[:, None] * left)


def turn_foot(
    motion: CanonicalMotion, group: Group, turn: Float[np.ndarray, "T 4"]
) -> CanonicalMotion:
    """`motion` with a foot, and what hangs on it, turned in world axes; itself without a turn."""
    if not turn[:, 1:].any():
        return motion
    foot = motion.rig.roles.require(LIMBS[group][2])
    joints = list(motion.rig.skeleton.subtree(foot))
    rotations = motion.rotations.copy()
    rotations[:, joints] = quat_mul(turn[:, None], rotations[:, joints])
    return replace(motion, rotations=rotations)
