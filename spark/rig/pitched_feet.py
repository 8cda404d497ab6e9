"""Rest poses whose feet do not stand flat: toes that hang, heels that are down.

A sole can't be seen in a skeleton, and how steeply a foot comes down from its ankle differs: by 4
to 45 degrees in flat shoes, by up to 70 on high heels. But toes lie on the floor, be the heels high
or not: in the rest poses of 60 characters and recorded people the bone from the toe joint on is
within 5 degrees of level, or slopes by 15 where toes curl. Where it slopes by more, the foot is
pitched with it, and stands as its toes do. Without such a bone, how the feet stand in the file's
own motion tells.
"""

import numpy as np
from jaxtyping import Float

from spark.kinematics import forward
from spark.rig.observed import standing_slope
from spark.rig.reference_pose import Reference
from spark.rig.roles import Role
from spark.rotation import (
    quat_conj,
    quat_from_rotvec,
    quat_from_yaw,
    quat_mul,
    quat_rotate,
)

_TOES_OF = {Role.LEFT_FOOT: Role.LEFT_TOE, Role.RIGHT_FOOT: Role.RIGHT_TOE}
# Toes that slope less are as they stand; below a foot that slopes more than `_STEEP` none curl.
_CURLED, _LEVEL, _STEEP = np.radians(18), np.radians(10), np.radians(-25)
_SEEN = np.radians(20)  # from how feet rest to how they are seen to stand; dancers roll off by less
# The slopes of feet that stand flat and not on high heels: none is turned beyond these.
_LOWEST, _HIGHEST = np.radians(-45), 0.0
_NO_HEADING = 0.05  # of a foot's length; one that reaches no further ahead hangs straight down
_STEEPEST, _HUMAN = np.radians(-75), np.radians(-21)  # no foot that stands slopes more; a human's
_UPRIGHT, _OFTEN = np.cos(np.radians(30)), 0.5  # of a pelvis, in so many of the frames

_LEFT, _UP = np.eye(3)[1:]

Vector = Float[np.ndarray, "3"]
Quat = Float[np.ndarray, "4"]


def flat_feet(reference: Reference, q_pelvis: Quat) -> tuple[dict[int, Quat], tuple[str, ...]]:
    """`q_world_joint` in the T-pose of feet that do not stand flat in the rest pose, straight ahead
    and flat, and a note; without any where they do. `q_pelvis` is the pelvis's in the T-pose.

    Both feet are taken to be pitched alike.
    """
    pose, roles = reference.pose, reference.pose.roles
    toe_of = {j: roles.joint(toe) for foot, toe in _TOES_OF.items() for j in roles.joints(foot)}
    # At rest all axes lie as the world's.
    bones = {j: quat_rotate(q_pelvis, bone) for j in toe_of if (bone := pose.bone(j)) is not None}
    tips = {
        j: quat_rotate(q_pelvis, tip)
        for j in bones
        if (toe := toe_of[j]) is not None and (tip := pose.bone(toe)) is not None
    }
    if not bones:
        return {}, ()
    slope = _mean_slope(bones)
    if tips:
        pitch, how = -_mean_slope(tips), "their toes are level"
        least = _LEVEL if slope < _STEEP and pitch > 0 else _CURLED
    else:
        stands, least, how = _seen(reference, q_pelvis, slope), _SEEN, "they are seen to stand"
        if stands < _STEEPEST:
            stands, how = _HUMAN, "a human's do, as nothing shows it"
        pitch = stands - slope
    pitch = float(np.clip(pitch, min(_LOWEST - slope, 0.0), max(_HIGHEST - slope, 0.0)))
    if abs(pitch) < least:
        return {}, ()
    found = {}
    for j, bone in bones.items():
        ahead = quat_from_yaw(-_heading(bone + tips.get(j, 0.0)))
        turn = quat_mul(quat_from_rotvec(-pitch * _LEFT), ahead)
        straight = quat_from_yaw(-_heading(quat_rotate(turn, bone)))
        found[j] = quat_mul(quat_mul(straight, turn), q_pelvis)
    off = f"{abs(np.degrees(pitch)):.0f} degrees {'down' if pitch > 0 else 'up'}"
    note = f"the feet point {off} in the rest pose: in the T-pose they are flat, as where {how}"
    return found, (note,)


def _seen(reference: Reference, q_pelvis: Quat, slope: float) -> float:
    """The slope [rad] of feet where they stand, while the body does; the given one of the rest pose
    where it hardly ever does."""
    motion, pose = reference.motion, reference.pose
    turned = quat_mul(forward(motion)[1][:, pose.roles.require(Role.PELVIS)], quat_conj(q_pelvis))
    upright = quat_rotate(turned, _UP)[:, 2] > _UPRIGHT
    if upright.mean() < _OFTEN:
        return slope
    feet = {j: pose.bone(j) for role in _TOES_OF for j in pose.roles.joints(role)}
    bones = {j: bone for j, bone in feet.items() if bone is not None}
    return standing_slope(motion, bones, upright)


def _mean_slope(bones: dict[int, Vector]) -> float:
    """Over the floor [rad]."""
    return float(np.mean([np.arctan2(v[2], np.hypot(v[0], v[1])) for v in bones.values()]))


def _heading(v: Vector) -> np.float64:
    """The yaw [rad] of a vector; 0 where it points straight down."""
    ahead = np.hypot(v[0], v[1]) > _NO_HEADING * np.linalg.norm(v)
    return np.float64(np.arctan2(v[1], v[0]) if ahead else 0.0)
