"""The pose that a T-pose is found from: the rest pose, or what a motion makes of it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from spark.errors import SkeletonError
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.bones import RigPose
from spark.rig.joint_axes import bones_at_right_angles, knees_at_right_angles, snap, tilt
from spark.rig.observed import mean_rotations, nearest_right_angle
from spark.rig.roles import (
    ENDS,
    HANDS,
    LIMB_OF,
    LIMBS,
    UPPER_ARMS,
    UPPER_LEGS,
    Group,
    Role,
    RoleMap,
    limb_joints,
)
from spark.rig.straight_fingers import stretch_fingers
from spark.rig.toes import SHORT
from spark.rotation import (
    quat_angle,
    quat_conj,
    quat_from_rotvec,
    quat_identity,
    quat_mul,
    quat_rotate,
    rotvec_from_quat,
)

_MAX_LEAN = np.radians(35)  # of a trunk from the axis that the body was built along
_MAX_HIP_TILT = np.radians(10)  # of the line of the hips from the axis across the body
_MAX_ODDS = np.radians(20)  # of a limb bone from the other side's, mirrored; built bodies have 10
_STILL = np.radians(2)  # joints that turn less than this from the rest pose show no more than it
_MAX_BACK = np.radians(20)  # of a joint of a spine that was built straight, in the mean pose
_UPRIGHT = 20  # the power of the cosine of a trunk's lean that a frame is weighed by

_TRUNK = (Role.PELVIS, Role.SPINE, Role.NECK, Role.HEAD)

_SIDES = {Group.LEFT_ARM: 1.0, Group.RIGHT_ARM: -1.0}
"""The limb that each limb role belongs to."""

Vector = Float[np.ndarray, "3"]
Quat = Float[np.ndarray, "4"]


@dataclass(frozen=True, eq=False)
class Reference:
    """The pose from which a T-pose is found.

    `posed`: it is the rest pose; else the mean pose of the motion stands in for it, and `square`
    tells that limb bones lie along their joints' coordinate axes, `square_legs` that knees bend
    about them as well, `straight` that the trunk's bones lie along them.
    """

    motion: Motion
    pose: RigPose
    posed: bool
    square: bool
    square_legs: bool
    straight: bool
    notes: tuple[str, ...]


def reference_of(motion: Motion, roles: RoleMap) -> Reference:
    """The rest pose where it is one that bodies are built in. Where it is none, or a moment of a
    movement, the mean pose of upright frames with straight fingers; on a square rig rounded to
    right angles, but for joints that have no role and keep still, and a trunk built as an S."""
    skeleton = motion.skeleton
    rest = RigPose(skeleton, roles, quat_identity(np.zeros((len(skeleton), 1))))
    why = _odds(rest) if _stands(rest) else "is not a pose"
    if why is None:
        return Reference(motion, rest, True, False, False, False, ())
    if (
        _stands(rest)
        and quat_angle(motion.rotations[:, 1:], rest.local[1:]).max(initial=0) < _STILL
    ):
        note = f"the rest pose {why}, and no other is in the file: the T-pose may be off"
        return Reference(motion, rest, True, False, False, False, (note,))
    square = straight = bones_at_right_angles(rest)
    mean = mean_rotations(motion.rotations, _uprightness(motion, roles))
    local = mean.copy()
    hands = [j for role in HANDS for j in roles.joints(role)]
    if square:
        turned = nearest_right_angle(mean)
        built = quat_angle(motion.rotations, mean).max(axis=0) < _STILL  # a hip joint's slant
        for j, role in enumerate(roles.roles):
            if role not in LIMB_OF and not (role is None and built[j]):
                local[j] = turned[j]
        bent = _bent_trunk(RigPose(skeleton, roles, turned), mean)
        straight = not bent
        for j, q in bent.items():
            local[j] = q
        for hand in hands:
            local[list(skeleton.subtree(hand)[1:])] = rest.local[0]
    else:
        for hand in hands:
            stretch_fingers(skeleton, hand, local)
    note = f"the rest pose {why}: the T-pose is found from the motion"
    pose = RigPose(skeleton, roles, local)
    square_legs = square and knees_at_right_angles(motion, pose)
    return Reference(motion, pose, False, square, square_legs, straight, (note,))


def _uprightness(motion: Motion, roles: RoleMap) -> Float[np.ndarray, "T"]:
    """How much each frame tells of how the body was built: half where the trunk leans by 15
    degrees. All frames tell the same where it lies in all."""
    positions, _ = forward(motion)
    *_, below, top = _landmarks(roles, positions.swapaxes(0, 1))
    trunk = top - below
    up = trunk[:, 2] / np.maximum(np.linalg.norm(trunk, axis=-1), SHORT)
    weights = np.maximum(up, 0.0) ** _UPRIGHT
    return weights / weights.max() if weights.max() > 0 else np.ones(len(motion))


def _stands(rest: RigPose) -> bool:
    """Whether the rest pose is a pose: hips or shoulders lie apart, legs don't point up along the
    trunk, and arms don't cross it."""
    lateral, up = _apart(rest), _trunk(rest)
    if lateral is None:
        return False
    for group in LIMBS:
        chain = limb_joints(rest.roles, group)
        limb = rest.positions[chain[-1]] - rest.positions[chain[0]] if chain else np.zeros(3)
        wrong = up if group not in _SIDES else -_SIDES[group] * lateral
        if limb @ wrong > 0.5 * np.linalg.norm(limb) * np.linalg.norm(wrong):
            return False
    return True


def _odds(rest: RigPose) -> str | None:
    """How a rest pose differs from its mirror image, as moments of movements do; None where arms
    and legs are built alike."""
    roles, lateral = rest.roles, _lateral(rest)
    worst, where = _MAX_ODDS, None
    for group in (Group.LEFT_LEG, Group.LEFT_ARM):
        for role in LIMBS[group]:
            pair = (roles.joint(role), roles.joint(role.mirrored))
            bones = [None if j is None or role in ENDS else _direction(rest, j) for j in pair]
            if bones[0] is None or bones[1] is None:
                continue
            image = bones[1] - 2 * lateral * (bones[1] @ lateral)
            odds = float(np.arccos(np.clip(bones[0] @ image, -1.0, 1.0)))
            if odds > worst:
                worst, where = odds, pair[0]
    if where is None:
        return None
    return (
        f"is a moment of a movement: {rest.skeleton.names[where]} points {np.degrees(worst):.0f} "
        "degrees away from the other side's, mirrored"
    )


def _direction(pose: RigPose, joint: int) -> Vector | None:
    """The unit vector along a joint's bone in the pose's world."""
    bone = pose.bone(joint)
    return None if bone is None else quat_rotate(pose.world[joint], bone / np.linalg.norm(bone))


def _bent_trunk(straight: RigPose, mean: Float[np.ndarray, "J 4"]) -> dict[int, Quat]:
    """The trunk's joints bent ahead and back as in the mean pose, from where their axes lie as the
    world's, where one of the spine bends far back: no one moves so, and it was built that way, as
    an S has to be. Else none."""
    roles, lateral = straight.roles, _lateral(straight)
    bent, least = {}, 0.0
    for j in (j for role in _TRUNK for j in roles.joints(role)):
        above = int(straight.skeleton.parents[j])
        world = straight.world[above] if above >= 0 else quat_identity(np.zeros(1))
        axis = quat_rotate(quat_conj(world), lateral)
        bend = axis @ rotvec_from_quat(quat_mul(mean[j], quat_conj(straight.local[j])))
        bent[j] = quat_mul(quat_from_rotvec(bend * axis), straight.local[j])
        least = min(least, bend) if roles.roles[j] is Role.SPINE else least
    return bent if least < -_MAX_BACK else {}


def pelvis_frame(reference: Reference) -> Float[np.ndarray, "3 3"]:
    """`R_T_pelvis`: rows forward, left and up, in the pelvis's own axes."""
    pose = reference.pose
    pelvis = pose.roles.require(Role.PELVIS)
    lateral, up = pose.seen_from(pelvis, _lateral(pose)), pose.seen_from(pelvis, _trunk(pose))
    # Artists build along the axes, whichever way the trunk leans; so do motion capture systems.
    if reference.posed:
        lateral = snap(lateral, _MAX_HIP_TILT)
        body = min(
            (_across(pose.seen_from(pelvis, line), lateral) for line in _lines(pose)), key=tilt
        )
        up = snap(body, _MAX_LEAN) if tilt(body) < _MAX_LEAN else up
    elif reference.square:
        lateral = snap(lateral, np.pi)
        up = _across(up, lateral)
        up = snap(up, _MAX_LEAN) if reference.straight else up
    up = _across(up, lateral)
    length = np.linalg.norm(up)
    if length < SHORT:
        raise SkeletonError("the trunk lies along the line of the hips: no direction is up")
    up = up / length
    return np.stack([np.cross(lateral, up), lateral, up])


def _lines(pose: RigPose) -> list[Vector]:
    """Lines [m] that a body may have been built along: from the feet to the hips and to its top, or
    along the trunk. Those that stand in the file, if any does: of one that squats in it the legs
    point elsewhere, of one that bends over the trunk does."""
    feet, hips, *top = _landmarks(pose.roles, pose.positions)
    legs = [hips - feet, *(v - feet for v in top)]
    lines = [*legs, *(v - hips for v in top)]
    return [v for v in lines if v[2] > np.cos(_MAX_LEAN) * np.linalg.norm(v)] or legs


def _lateral(pose: RigPose) -> Vector:
    """The unit vector from the right hip to the left one, or between the shoulders."""
    lateral = _apart(pose)
    if lateral is None:
        raise SkeletonError("hips and shoulders lie in one point each: no direction is left")
    return lateral


def _apart(pose: RigPose) -> Vector | None:
    """The same; None where hips lie in one point, and shoulders too."""
    for pair in (UPPER_LEGS, UPPER_ARMS):
        left, right = (pose.roles.joint(role) for role in pair)
        if left is not None and right is not None:
            across = pose.positions[left] - pose.positions[right]
            if np.linalg.norm(across) > SHORT:
                return across / np.linalg.norm(across)
    return None


def _trunk(pose: RigPose) -> Vector:
    """The vector [m] from the hips to the head; without a trunk, from the feet to the hips."""
    *_, below, top = _landmarks(pose.roles, pose.positions)
    return top - below


def _landmarks(roles: RoleMap, at: Float[np.ndarray, "J *T 3"]) -> list[Float[np.ndarray, "*T 3"]]:
    """The feet's middle, the hips' middle, and the head or the trunk's topmost joint if any, from
    where the joints are."""
    hips = np.mean([at[roles.require(role)] for role in UPPER_LEGS], axis=0)
    feet = np.mean([at[limb_joints(roles, LIMB_OF[role])[-1]] for role in UPPER_LEGS], axis=0)
    tops = [j for role in (Role.HEAD, Role.NECK, Role.SPINE) for j in roles.joints(role)[-1:]]
    return [feet, hips, *(at[j] for j in tops[:1])]


def _across(v: Vector, lateral: Vector) -> Vector:
    return v - lateral * (v @ lateral)
