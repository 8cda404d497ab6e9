"""The T-pose of any rig: what its rotations are measured from.

Directions come from the definition: legs down, arms out, feet forward. The twist about a bone does
not follow from a direction: it is that of the rest pose, brought into the T by the smallest
rotations from the body outwards. Hanging arms then rise sideways and their palms turn down. Trunk,
neck and head keep the posture that the rig's artist gave them.

Some files' rest pose is no pose at all (LAFAN1, Rokoko: every bone along one local axis), and some
files rest in the middle of a step. There the mean pose of the motion stands in for it, and the axes
that knees and elbows bend about settle the twist. Rigs of the first kind are built with their joint
axes at right angles as a rule, so twists are rounded to them, but for legs whose knees bend about
none of their axes: all clips of a rig give the same T-pose, but for the posture of a curved spine.
"""

from itertools import pairwise

import numpy as np
from jaxtyping import Float

from spark.motion import Motion
from spark.rig.doubles import doubles_of
from spark.rig.joint_axes import snap, turn_about
from spark.rig.moving_feet import feet_ahead, feet_slope
from spark.rig.nulls import all_but, motion_of, nulls_of
from spark.rig.observed import bend_axis, mean_rotations, nearest_right_angle
from spark.rig.pitched_feet import flat_feet
from spark.rig.reference_pose import Reference, pelvis_frame, reference_of
from spark.rig.roles import ANKLES, CLAVICLES, HANDS, LIMB_OF, LIMBS, Group, Role, RoleMap
from spark.rotation import (
    quat_angle,
    quat_between,
    quat_conj,
    quat_from_matrix,
    quat_from_rotvec,
    quat_from_yaw,
    quat_identity,
    quat_mul,
    quat_rotate,
)
from spark.skeleton import Skeleton

_MAX_ROLL = np.radians(100)  # of a forearm from its middle: pronation and supination reach 85 each
_MAX_NOD = np.radians(60)  # of a head in the mean
_MAX_FINGER_SPREAD = np.radians(35)  # of the fingers' middle from the hand's axis they lie along
_MAX_SKEW = np.radians(20)  # of a palm from right angles, on an arm that was built with its turn
_BESIDE = np.sin(np.radians(5))  # of a thumb to its hand's axis; nearer to it it tells no side
_STEEPEST_FOOT = np.radians(-75)  # a foot that points further down at rest is not standing

_LEFT, _UP = np.eye(3)[1:]
_TOES = (Role.LEFT_TOE, Role.RIGHT_TOE)
_BENT = {  # the segment below, and the axis that it bends about in the T-pose
    Role.LEFT_UPPER_LEG: (Role.LEFT_LOWER_LEG, _LEFT),
    Role.RIGHT_UPPER_LEG: (Role.RIGHT_LOWER_LEG, _LEFT),
    Role.LEFT_UPPER_ARM: (Role.LEFT_FOREARM, -_UP),
    Role.RIGHT_UPPER_ARM: (Role.RIGHT_FOREARM, _UP),
}
_ROLLING = (Role.LEFT_FOREARM, Role.RIGHT_FOREARM, *HANDS)
_OUT = {Group.LEFT_ARM: _LEFT, Group.RIGHT_ARM: -_LEFT}

Vector = Float[np.ndarray, "3"]
Quat = Float[np.ndarray, "4"]


def find_tpose(motion: Motion, roles: RoleMap) -> tuple[Float[np.ndarray, "J 4"], tuple[str, ...]]:
    """Each joint's `q_world_joint` in the T-pose, and notes on what was assumed.

    Pelvis upright facing +X, legs straight down, arms straight along +-Y with palms down, feet
    towards +X with their soles flat. Joints above the root joint stay as they rest.
    Raises SkeletonError where the rig has no lateral axis or no legs.
    """
    first = root_joint_of(motion.skeleton, roles)
    nulls = {
        j: k for j, k in nulls_of(motion.skeleton).items() if j >= first and roles.roles[j] is None
    }
    kept = all_but([*nulls], motion.skeleton)
    tpose = quat_identity(np.zeros((len(motion.skeleton), 1)))
    bare, of_bare = motion_of(motion, kept), roles.of(kept.tolist())
    reference = reference_of(bare, of_bare)
    tpose[kept], notes = _find(reference, of_bare)
    for null in sorted(nulls, reverse=True):
        carried = nulls[null]
        in_null = quat_identity(tpose[null])
        if not reference.posed:
            in_null = mean_rotations(motion.rotations[:, carried], np.ones(len(motion)))
        tpose[null] = quat_mul(tpose[carried], quat_conj(in_null))
    return tpose, notes


def _find(reference: Reference, roles: RoleMap) -> tuple[Float[np.ndarray, "J 4"], tuple[str, ...]]:
    """The same, of a skeleton without nulls."""
    skeleton = reference.motion.skeleton
    tpose = quat_identity(np.zeros((len(skeleton), 1)))
    pelvis = roles.require(Role.PELVIS)
    tpose[pelvis] = quat_from_matrix(pelvis_frame(reference))
    above = skeleton.ancestors(pelvis)
    root_joint = root_joint_of(skeleton, roles)
    for child, j in pairwise(above):
        if j >= root_joint:
            tpose[j] = quat_mul(tpose[child], quat_conj(reference.pose.local[child]))
    notes = list(reference.notes)
    doubles = doubles_of(skeleton, roles.roles)
    feet: dict[int, Quat] | None = None
    if reference.posed:
        feet, more = flat_feet(reference, tpose[pelvis])
        notes += more
    for j in _in_order(skeleton, roles, doubles):
        if j in above:
            continue
        if j in doubles:  # at rest all axes lie as the world's
            tpose[j] = tpose[doubles[j]]
            continue
        parent = tpose[int(skeleton.parents[j])]
        q = quat_mul(parent, reference.pose.local[j])
        role = roles.roles[j]
        if feet is None and role in ANKLES:
            feet, more = feet_ahead(reference, tpose)
            notes += more
        if feet and j in feet:
            q = feet[j]
        elif role in ANKLES or role in _TOES:
            q = _place_foot(reference, j, role, q, tpose[pelvis])
        elif role is not None and role in LIMB_OF:
            q = _place(reference, j, role, q, parent)
        elif role is Role.HEAD and reference.square:
            q = _skull(q, tpose[(pelvis, *roles.joints(Role.SPINE))[-1]])
        if role in HANDS:
            q, turn, note = _palm_down(reference, j, q)
            notes += note
            if turn is not None:
                arm = _turned_with_hand(reference, j, role, turn, tpose)
                tpose[arm] = quat_mul(turn, tpose[arm])
        tpose[j] = q
    return tpose, tuple(notes)


def _in_order(skeleton: Skeleton, roles: RoleMap, doubles: dict[int, int]) -> list[int]:
    """All joints, parents before children, feet after both legs, doubles' chains after all."""
    feet = {k for role in ANKLES for j in roles.joints(role) for k in skeleton.subtree(j)}
    later = {k for j in doubles for k in skeleton.subtree(j)}
    return sorted(range(len(skeleton)), key=lambda j: (j in later, j in feet))


def root_joint_of(skeleton: Skeleton, roles: RoleMap) -> int:
    """The joint that takes the body through the world: the lowest one whose position the file
    animates that carries all of it. That is the pelvis, or a joint above that carries the trunk
    beside it, as MakeHuman's and Character Creator's, or that alone can move."""
    held = {*roles.held}
    return next(
        (
            j
            for j in skeleton.ancestors(roles.require(Role.PELVIS))
            if skeleton.translating[j] and held.issubset(skeleton.subtree(j))
        ),
        0,
    )


def _place(reference: Reference, joint: int, role: Role, q: Quat, q_parent: Quat) -> Quat:
    """A limb joint's rotation in the T-pose, from `q`, where its parent and the pose take it."""
    bone = reference.pose.bone(joint)
    if bone is None or (role in CLAVICLES and reference.posed):
        return q
    arm = LIMB_OF[role] in _OUT
    goal = _OUT.get(LIMB_OF[role], -_UP)
    if reference.square and role in HANDS:
        bone = snap(bone, _MAX_FINGER_SPREAD)
    q = quat_mul(quat_between(quat_rotate(q, bone), goal), q)
    if role in _BENT and not reference.posed:
        q = quat_mul(_twist_to_bend(reference, joint, bone, role, q, goal), q)
    if reference.square:
        straight = quat_mul(quat_between(quat_rotate(q_parent, bone), goal), q_parent)
        if role in _ROLLING and quat_angle(q, straight) < _MAX_ROLL:
            q = straight
        if arm or reference.square_legs:
            q = _square(q, goal, _UP if arm else _LEFT)
    return q


def _skull(q: Quat, chest: Quat) -> Quat:
    """A head's rotation by right angles: a skull has no curve, as the spine below it may have. Rigs
    turn its axes as the chest's, as a rule, and dancers look down."""
    as_chest = nearest_right_angle(chest)
    return as_chest if quat_angle(q, as_chest) < _MAX_NOD else nearest_right_angle(q)


def _place_foot(reference: Reference, joint: int, role: Role, q: Quat, q_pelvis: Quat) -> Quat:
    """Straight ahead, sloped as at rest or as the motion shows it; toes level."""
    if reference.posed and role in _TOES:
        return q
    bone = reference.pose.bone(joint)
    if reference.posed:
        q = q_pelvis  # the sole is as flat as at rest, wherever the leg went
        if bone is None:
            return q
        x, y, z = quat_rotate(q, bone)
        if np.arctan2(z, np.hypot(x, y)) > _STEEPEST_FOOT:
            return quat_mul(quat_from_yaw(-np.arctan2(y, x)), q)
    if bone is None:
        return q
    slope = feet_slope(reference)[0] if role in ANKLES else 0.0
    goal = np.array([np.cos(slope), 0.0, np.sin(slope)])
    q = quat_mul(quat_between(quat_rotate(q, bone), goal), q)
    return _square(q, goal, _LEFT) if reference.square_legs else q


def _twist_to_bend(
    reference: Reference, upper: int, bone: Vector, role: Role, q: Quat, goal: Vector
) -> Quat:
    """The rotation about `goal` after which the joint below bends about the T-pose's axis."""
    lower_role, axis = _BENT[role]
    lower = reference.pose.roles.joint(lower_role)
    lower_bone = None if lower is None else reference.pose.bone(lower)
    if lower is None or lower_bone is None:
        return quat_identity(goal)
    bent = bend_axis(reference.motion, upper, lower, bone, lower_bone)
    return quat_identity(goal) if bent is None else turn_about(quat_rotate(q, bent), axis, goal)


def _square(q: Quat, about: Vector, side: Vector) -> Quat:
    """`q` turned about a vector until the nearest of its axes points to a side."""
    axes = quat_rotate(q, np.concatenate([np.eye(3), -np.eye(3)]))
    across = axes - np.outer(axes @ about, about)
    nearest = across[np.argmax(across @ side)]
    return quat_mul(turn_about(nearest, side, about), q)


def _palm_down(
    reference: Reference, hand: int, q: Quat
) -> tuple[Quat, Quat | None, tuple[str, ...]]:
    """`q`, turned by right angles where thumb or fingers say that the palm faces elsewhere; by as
    much as a row of fingers says where a mean pose stands in for the rest pose. And that turn,
    where the arm was built with it: clearly by right angles."""
    pose = reference.pose
    found = pose.thumb_side(hand)
    if found is None:
        return q, None, ()
    side, droop = found
    seen = quat_rotate(q, side)
    if np.hypot(seen[0], seen[2]) < _BESIDE * np.linalg.norm(seen):
        return q, None, ()
    angle = np.arctan2(-seen[2], seen[0]) - droop
    quarter_turns = round(angle / (np.pi / 2))
    right_angle = quarter_turns * (np.pi / 2)
    built = reference.posed and abs(angle - right_angle) < _MAX_SKEW
    if reference.posed or reference.square or droop:
        angle = right_angle
    turn = quat_from_rotvec(-_LEFT * angle)
    q = quat_mul(turn, q)
    if quarter_turns == 0:
        return q, None, ()
    note = f"{pose.skeleton.names[hand]} is turned by {90 * quarter_turns} degrees: palms face down"
    return q, turn if built else None, (note,)


def _turned_with_hand(
    reference: Reference, hand: int, role: Role, turn: Quat, tpose: Float[np.ndarray, "J 4"]
) -> list[int]:
    """The joints of an arm that turn as its palm does: the forearm, as no wrist rolls, and the
    upper arm where the elbow bends about a better axis then."""
    skeleton, roles = reference.motion.skeleton, reference.pose.roles
    upper_role, forearm_role = LIMBS[LIMB_OF[role]][1:3]
    top = roles.joint(forearm_role)
    upper = roles.joint(upper_role)
    if top is None:
        return []
    bones = None if upper is None else reference.pose.bone(upper), reference.pose.bone(top)
    if upper is not None and bones[0] is not None and bones[1] is not None:
        bent = bend_axis(reference.motion, upper, top, bones[0], bones[1])
        if bent is not None:
            before = quat_rotate(tpose[upper], bent)
            goal = _BENT[upper_role][1]
            top = upper if quat_rotate(turn, before) @ goal > before @ goal else top
    return list(skeleton.subtree(top))
