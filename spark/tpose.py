"""The T-pose of any rig: what its rotations are measured from.

Directions come from the definition: legs down, arms out, feet forward. The twist about a bone does
not follow from a direction: it is that of the rest pose, brought into the T by the smallest
rotations from the body outwards. Hanging arms then rise sideways and their palms turn down. Trunk,
neck and head keep the posture that the rig's artist gave them.

Some rigs' rest pose is no pose at all (LAFAN1, Rokoko: every bone along one local axis). There the
mean pose of the motion stands in for it, and the axes that knees and elbows bend about settle the
twist; such axes are a joint's coordinate axes, so that all clips of a rig give the same T-pose.
"""

from itertools import product

import numpy as np
from jaxtyping import Float

from spark.kinematics import forward
from spark.motion import Motion
from spark.roles import LIMBS, Group, Role, RoleMap
from spark.rotation import (
    quat_between,
    quat_from_matrix,
    quat_from_rotvec,
    quat_identity,
    quat_mul,
    quat_rotate,
    rotvec_from_quat,
)
from spark.skeleton import Skeleton

_SNAP = np.cos(np.radians(25))  # a direction this near to a coordinate axis is meant to be it
_BENDS = np.radians(10)  # a joint that bends less than this in a clip does not show its axis
_TINY = 1e-6  # bones shorter than this [m] have no direction

_FEET = (Role.LEFT_FOOT, Role.RIGHT_FOOT)
_BENT = {  # upper segment: the lower one, and the axis that it bends about in the T-pose
    Role.LEFT_UPPER_LEG: (Role.LEFT_LOWER_LEG, np.array([0.0, 1, 0])),
    Role.RIGHT_UPPER_LEG: (Role.RIGHT_LOWER_LEG, np.array([0.0, 1, 0])),
    Role.LEFT_UPPER_ARM: (Role.LEFT_FOREARM, np.array([0.0, 0, -1])),
    Role.RIGHT_UPPER_ARM: (Role.RIGHT_FOREARM, np.array([0.0, 0, 1])),
}

# The 24 turns of a cube: rigs are built with joint axes at right angles.
_RIGHT_ANGLES = np.array(
    [
        q / np.linalg.norm(q)
        for q in np.array(list(product((-1, 0, 1), repeat=4)), dtype=np.float64)
        if tuple(q) > (0, 0, 0, 0) and np.count_nonzero(q) in (1, 2, 4)
    ]
)

Vector = Float[np.ndarray, "3"]
Quat = Float[np.ndarray, "4"]


def find_tpose(motion: Motion, roles: RoleMap) -> Float[np.ndarray, "J 4"]:
    """Each joint's `q_world_joint` in the T-pose.

    Pelvis upright facing +X, legs straight down, arms straight along +-Y with palms down, feet
    towards +X with their soles flat. Joints above the one that carries the body stay as they rest.
    """
    skeleton = motion.skeleton
    pelvis = roles.require(Role.PELVIS)
    frame = _pelvis_frame(skeleton, roles)
    posed = _legs_hang(skeleton, roles, frame)
    q_pelvis = quat_from_matrix(frame)
    identity = quat_identity(np.zeros((len(skeleton), 1)))
    reference = identity if posed else _typical_rotations(motion.rotations)
    goals = _goals(motion, roles, posed, q_pelvis)

    tpose = identity.copy()
    carrier = carrier_of(skeleton, pelvis)
    for j in range(len(skeleton)):
        if j in skeleton.ancestors(pelvis):
            tpose[j] = q_pelvis if j >= carrier else identity[j]
            continue
        role = roles.roles[j]
        q = quat_mul(tpose[int(skeleton.parents[j])], reference[j])
        if posed and role in _FEET:
            q = q_pelvis  # the sole is as flat as in the rest pose, wherever the leg went
        if j in goals:
            bone, goal = goals[j]
            q = quat_mul(quat_between(quat_rotate(q, bone), goal), q)
            if not posed and role in _BENT:
                q = quat_mul(_twist_to_bend(motion, roles, role, q, goal), q)
        tpose[j] = q
    return tpose


def carrier_of(skeleton: Skeleton, pelvis: int) -> int:
    """The joint that takes the body through the world: the pelvis, or the nearest joint above it
    that the file can move."""
    return next((j for j in skeleton.ancestors(pelvis) if skeleton.translating[j]), 0)


def bone_vector(skeleton: Skeleton, roles: RoleMap, joint: int) -> Vector | None:
    """The rest vector [m] of a limb joint's bone: to the next joint of its limb, or, at the end of
    the limb, to the middle of all that hangs there. None where nothing shows a direction."""
    rest = skeleton.rest_positions
    role = roles.roles[joint]
    for limb in LIMBS.values():
        if role not in limb:
            continue
        for after in limb[limb.index(role) + 1 :]:
            for j in roles.joints(after):
                vector = rest[j] - rest[joint]
                if joint in skeleton.ancestors(j) and np.linalg.norm(vector) > _TINY:
                    return vector
    below = list(skeleton.subtree(joint))
    tips = np.isin(skeleton.end_parents, below)
    points = np.concatenate(
        [rest[below[1:]], rest[skeleton.end_parents[tips]] + skeleton.end_offsets[tips]]
    )
    if not len(points):
        return None
    vector = points.mean(0) - rest[joint]
    return vector if np.linalg.norm(vector) > _TINY else None


def _goals(
    motion: Motion, roles: RoleMap, posed: bool, q_pelvis: Quat
) -> dict[int, tuple[Vector, Vector]]:
    """For each limb joint its bone in the rest pose, and where that bone points in the T-pose."""
    goals: dict[int, tuple[Vector, Vector]] = {}
    for group, limb in LIMBS.items():
        arm = group in (Group.LEFT_ARM, Group.RIGHT_ARM)
        out = np.array([0.0, 1.0 if group is Group.LEFT_ARM else -1.0, 0.0])
        for place, role in enumerate(limb):
            for j in roles.joints(role):
                bone = bone_vector(motion.skeleton, roles, j)
                if bone is None:
                    continue
                if arm and (place > 0 or not posed):
                    goals[j] = bone, out
                elif not arm and place < 2:
                    goals[j] = bone, np.array([0.0, 0, -1])
                elif role in _FEET:
                    goals[j] = bone, _foot_goal(motion, j, bone, q_pelvis if posed else None)
    return goals


def _foot_goal(motion: Motion, foot: int, bone: Vector, q_rest: Quat | None) -> Vector:
    """Straight ahead, with the slope that the foot has in the rest pose, or when it is low."""
    if q_rest is not None:
        along = quat_rotate(q_rest, bone)
    else:
        positions, world = forward(motion)
        height = positions[:, foot, 2]
        low = height <= np.percentile(height, 30)
        steps = quat_rotate(world[low, foot], bone)
        flat = np.hypot(steps[:, 0], steps[:, 1])
        along = np.array([np.median(flat), 0, np.median(steps[:, 2])])
    return np.array([np.hypot(along[0], along[1]), 0.0, along[2]])


def _twist_to_bend(motion: Motion, roles: RoleMap, role: Role, q: Quat, bone: Vector) -> Quat:
    """The rotation about `bone` after which the joint below bends about the T-pose's axis."""
    still = np.array([1.0, 0, 0, 0])
    lower_role, goal = _BENT[role]
    lower = roles.joint(lower_role)
    if lower is None:
        return still
    turns = rotvec_from_quat(motion.rotations[:, lower])
    if np.percentile(np.linalg.norm(turns, axis=-1), 95) < _BENDS:
        return still
    axis = np.linalg.eigh(turns.T @ turns)[1][:, -1]
    axis = _snap(axis if axis @ turns.sum(0) >= 0 else -axis)
    seen = quat_rotate(q, axis)
    seen = seen - bone * (seen @ bone)
    if np.linalg.norm(seen) < 0.3:  # it twists more than it bends
        return still
    return quat_from_rotvec(bone * np.arctan2(np.cross(seen, goal) @ bone, seen @ goal))


def _pelvis_frame(skeleton: Skeleton, roles: RoleMap) -> Float[np.ndarray, "3 3"]:
    """`R_T_rest` of the pelvis: rows forward, left and up of the rest pose."""
    rest = skeleton.rest_positions
    left = rest[roles.require(Role.LEFT_UPPER_LEG)]
    right = rest[roles.require(Role.RIGHT_UPPER_LEG)]
    tops = [j for role in (Role.HEAD, Role.NECK, Role.SPINE) for j in roles.joints(role)]
    middle = (left + right) / 2
    trunk = rest[tops[0]] - middle if tops else np.array([0.0, 0, 1])
    lateral = _snap(left - right)
    lateral = lateral / np.linalg.norm(lateral)
    up = _snap(trunk - lateral * (trunk @ lateral))
    up = up - lateral * (up @ lateral)
    up = up / np.linalg.norm(up)
    return np.stack([np.cross(lateral, up), lateral, up])


def _legs_hang(skeleton: Skeleton, roles: RoleMap, frame: Float[np.ndarray, "3 3"]) -> bool:
    """Whether the rest pose is a pose: both legs below the trunk."""
    rest = skeleton.rest_positions
    for upper, (lower, _) in list(_BENT.items())[:2]:
        thigh = frame @ (rest[roles.require(lower)] - rest[roles.require(upper)])
        if thigh[2] > -0.5 * np.linalg.norm(thigh):
            return False
    return True


def _typical_rotations(rotations: Float[np.ndarray, "T J 4"]) -> Float[np.ndarray, "J 4"]:
    """The mean rotation of each joint over time (Markley et al. 2007), or the turn by right angles
    that it is near to: that is then how the rig was built, and the rest how the actor stood."""
    moments = np.einsum("tji,tjk->jik", rotations, rotations)
    mean = np.linalg.eigh(moments)[1][..., -1]
    near = np.abs(mean @ _RIGHT_ANGLES.T)
    best = near.argmax(-1)
    built = near.max(-1) > np.cos(np.radians(35) / 2)
    return np.where(built[:, None], _RIGHT_ANGLES[best], mean)


def _snap(v: Vector) -> Vector:
    """`v`, or the coordinate axis that it is near to."""
    k = int(np.argmax(np.abs(v)))
    if abs(v[k]) > _SNAP * np.linalg.norm(v):
        return np.eye(3)[k] * np.sign(v[k])
    return v
