"""Where the parts of a body point: the segments of its limbs, and its trunk."""

import numpy as np
from jaxtyping import Float

from spark.rig.rig import Rig
from spark.rig.roles import LEGS, LIMBS, UPPER_ARMS, Group, Role
from spark.rotation import quat_rotate

LIMB_SEGMENTS = (  # the limbs' segments, by the roles at their ends
    (Role.LEFT_UPPER_LEG, Role.LEFT_LOWER_LEG),
    (Role.LEFT_LOWER_LEG, Role.LEFT_FOOT),
    (Role.RIGHT_UPPER_LEG, Role.RIGHT_LOWER_LEG),
    (Role.RIGHT_LOWER_LEG, Role.RIGHT_FOOT),
    (Role.LEFT_UPPER_ARM, Role.LEFT_FOREARM),
    (Role.LEFT_FOREARM, Role.LEFT_HAND),
    (Role.RIGHT_UPPER_ARM, Role.RIGHT_FOREARM),
    (Role.RIGHT_FOREARM, Role.RIGHT_HAND),
)
TPOSE_DIRECTIONS = {
    **{role: np.array([0.0, 0, -1]) for g in LEGS for role in LIMBS[g]},
    **{role: np.array([0.0, 1, 0]) for role in LIMBS[Group.LEFT_ARM]},
    **{role: np.array([0.0, -1, 0]) for role in LIMBS[Group.RIGHT_ARM]},
}


def bone_directions(
    rig: Rig, positions: Float[np.ndarray, "T J 3"], rotations: Float[np.ndarray, "T J 4"]
) -> dict[Role, Float[np.ndarray, "T 3"]]:
    """Where the segments of arms and legs point: from joint to joint, or, where the joint at the
    far end is missing, as its rotation since the T-pose says."""
    out = {}
    for upper, lower in LIMB_SEGMENTS:
        a, b = rig.roles.joint(upper), rig.roles.joint(lower)
        if a is None:
            continue
        if b is not None:
            bone = positions[:, b] - positions[:, a]
            length = np.linalg.norm(bone, axis=-1, keepdims=True)
            if length.min() > 1e-6:
                out[upper] = bone / length
                continue
        out[upper] = quat_rotate(rotations[:, a], TPOSE_DIRECTIONS[upper])
    return out


def hips_to_shoulders(rig: Rig, positions: Float[np.ndarray, "T J 3"]) -> Float[np.ndarray, "T 3"]:
    """From the middle of the hips to that of the shoulders [m], of a rig that has these."""
    along: Float[np.ndarray, "T 3"] = positions[:, shoulder_joints(rig)].mean(1)
    return along - positions[:, rig.hips].mean(1)


def has_shoulders(rig: Rig) -> bool:
    """Whether there is an upper arm on both sides."""
    return all(rig.roles.joints(role) for role in UPPER_ARMS)


def shoulder_joints(rig: Rig) -> list[int]:
    """The upper arms' joints, left and right, of a rig that has these."""
    return [rig.roles.joints(role)[0] for role in UPPER_ARMS]
