"""Whether a rig's joints have their coordinate axes along what they carry and turn about."""

import numpy as np
from jaxtyping import Float

from spark.motion import Motion
from spark.rig.bones import RigPose
from spark.rig.observed import bend_axis
from spark.rig.roles import LIMBS, LOWER_LEGS, UPPER_LEGS, limb_joints
from spark.rig.toes import SHORT
from spark.rotation import quat_from_rotvec

_ALIGNED = np.radians(10)  # of a bone from an axis of its joint that it was put along on purpose
_SLANTED = np.radians(25)  # of both knees' axes from joints' axes; found ones are off by up to 20


Vector = Float[np.ndarray, "3"]


def bones_at_right_angles(rest: RigPose) -> bool:
    """Whether all limb bones lie along coordinate axes of their joints."""
    bones = (rest.bone(j) for group in LIMBS for j in limb_joints(rest.roles, group)[:-1])
    return all(bone is None or tilt(bone) < _ALIGNED for bone in bones)


def knees_at_right_angles(motion: Motion, pose: RigPose) -> bool:
    """Whether a knee bends about a coordinate axis, as far as the motion shows one."""
    tilts = []
    for upper, lower in zip(UPPER_LEGS, LOWER_LEGS, strict=True):
        thigh, shank = pose.roles.joint(upper), pose.roles.joint(lower)
        if thigh is None or shank is None:
            continue
        bones = pose.bone(thigh), pose.bone(shank)
        if bones[0] is not None and bones[1] is not None:
            axis = bend_axis(motion, thigh, shank, bones[0], bones[1])
            tilts.append(0.0 if axis is None else tilt(axis))
    return bool(min(tilts, default=0.0) < _SLANTED)


def snap(v: Vector, tolerance: float) -> Vector:
    """The coordinate axis that is nearest to `v`, or `v` itself where none is that near."""
    k = int(np.argmax(np.abs(v)))
    return np.eye(3)[k] * np.sign(v[k]) if tilt(v) < tolerance else v


def tilt(v: Vector) -> float:
    """The angle [rad] between a vector and the nearest coordinate axis."""
    return float(np.arccos(min(np.abs(v).max() / max(np.linalg.norm(v), SHORT), 1.0)))


def turn_about(u: Vector, v: Vector, axis: Vector) -> Float[np.ndarray, "4"]:
    """The rotation about the unit `axis` that brings `u` as near to `v` as it can."""
    u = u - axis * (u @ axis)
    return quat_from_rotvec(axis * np.arctan2(np.cross(u, v) @ axis, u @ v))
