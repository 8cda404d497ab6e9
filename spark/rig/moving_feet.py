"""The feet of a T-pose that is found from a motion: straight ahead, soles down.

Toes that fan out show which side is the sole. Else the ankles do: rigs turn foot and shank about
the same axis as a rule, and each frame has a vote.
"""

import numpy as np
from jaxtyping import Float

from spark.motion import Motion
from spark.rig.bones import RigPose
from spark.rig.joint_axes import turn_about
from spark.rig.observed import resting_slope, standing_slope
from spark.rig.reference_pose import Reference
from spark.rig.roles import Role
from spark.rotation import (
    quat_between,
    quat_conj,
    quat_from_rotvec,
    quat_mul,
    quat_rotate,
)

_QUARTER = np.pi / 2
_TOES_UP = np.radians(5)  # of a foot that is built level, as far as standing feet show it
_HEELS = np.radians(10)  # a foot that points further up where it stands is not as it was built
_COS_AHEAD = np.cos(np.radians(75))  # of a foot to where it points in the T-pose; others don't vote
_HINGE = np.array([0.3, 0, 0, 0])  # of all votes, for a foot that turns about its shank's axis
_CLEAR = 0.6  # of all votes, for one of the four sides
_ALONG = 0.7  # the cosine of a foot's bone to its shank's axis across, about which it can't bend
_TOES = range(4, 6)  # joints side by side
_STAGGER = 0.1  # of a fan's width, that the big toe's root lies ahead of the little toe's

_LEFT, _UP = np.eye(3)[1:]
_SIGNS = {Role.LEFT_FOOT: 1, Role.RIGHT_FOOT: -1}

Vector = Float[np.ndarray, "3"]
Quat = Float[np.ndarray, "4"]


def feet_ahead(
    reference: Reference, tpose: Float[np.ndarray, "J 4"]
) -> tuple[dict[int, Quat], tuple[str, ...]]:
    """`q_world_joint` of each foot that has a bone, and notes; `tpose` is known above the feet."""
    pose, motion = reference.pose, reference.motion
    feet = {j: role for role in _SIGNS for j in pose.roles.joints(role)}
    bones = {j: bone for j in feet if (bone := pose.bone(j)) is not None}
    slope, notes = feet_slope(reference)
    goal = np.array([np.cos(slope), 0.0, np.sin(slope)])
    found = {}
    for j, bone in bones.items():
        shank = tpose[int(motion.skeleton.parents[j])]
        q = _pointed(quat_mul(shank, pose.local[j]), bone, goal)
        votes = np.zeros(4)
        if reference.square_legs:
            q = _hinged(q, shank, bone, goal)
            votes = _votes(motion, j, bone, goal, shank, q)
        quarters = int(np.argmax(votes + _HINGE))
        up = _up_by_toes(pose, j, _SIGNS[feet[j]])
        if up is not None:
            up = quat_rotate(q, up)
            quarters = round(np.arctan2(np.cross(up, _UP) @ goal, up @ _UP) / _QUARTER)
        if votes[quarters % 4] < _CLEAR * votes.sum():
            how = "is a guess" if up is None else "is told by its toes"
            name = motion.skeleton.names[j]
            notes += (f"which side of {name} is its sole {how}: it is turned over in many frames",)
        found[j] = quat_mul(quat_from_rotvec(goal * quarters * _QUARTER), q)
    return found, notes


def feet_slope(reference: Reference) -> tuple[float, tuple[str, ...]]:
    """The slope [rad] of the feet: of ankles at rest, else of standing feet. Both are alike, and no
    foot is built with its toes above its ankle; a note where they stand so."""
    pose, motion = reference.pose, reference.motion
    bones = {
        j: bone
        for role in _SIGNS
        for j in pose.roles.joints(role)
        if (bone := pose.bone(j)) is not None
    }
    if not bones:
        return 0.0, ()
    resting = []
    for j, bone in bones.items():
        shank = pose.bone(int(motion.skeleton.parents[j]))
        if shank is not None:
            resting.append(resting_slope(motion, j, bone, shank))
    found = [slope for slope in resting if slope is not None]
    slope = float(np.mean(found)) if found else standing_slope(motion, bones)
    if slope < _HEELS:
        return min(slope, _TOES_UP), ()
    return _TOES_UP, (
        f"the feet stand with their toes {np.degrees(slope):.0f} degrees above the ankles: "
        "about level in the T-pose, which may be off",
    )


def _pointed(q: Float[np.ndarray, "*n 4"], bone: Vector, goal: Vector) -> Float[np.ndarray, "*n 4"]:
    """`q` by the smallest rotation after which the bone points to a goal."""
    return quat_mul(quat_between(quat_rotate(q, bone), goal), q)


def _hinged(q: Quat, shank: Quat, bone: Vector, goal: Vector) -> Quat:
    """`q` turned about its bone until the axis points left that does so in the shank, and which
    the foot bends about then; on a rig of other habits the axis that is nearest to it."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    across = axes[np.argmax(quat_rotate(shank, axes) @ _LEFT)]
    if abs(across @ bone) > _ALONG * np.linalg.norm(bone):
        across = axes[np.argmax(quat_rotate(q, axes) @ _LEFT)]
    return quat_mul(turn_about(quat_rotate(q, across), _LEFT, goal), q)


def _votes(
    motion: Motion, foot: int, bone: Vector, goal: Vector, shank: Quat, q: Quat
) -> Float[np.ndarray, "4"]:
    """In which part of the frames the foot is turned by 0 to 3 quarters from `q` about its bone."""
    moving = quat_mul(shank, motion.rotations[:, foot])
    ahead = quat_rotate(moving, bone) @ goal > _COS_AHEAD * np.linalg.norm(bone)
    turn = quat_mul(_pointed(moving, bone, goal), quat_conj(q))
    roll = 2 * np.arctan2(turn[:, 1:] @ goal, turn[:, 0])
    quarters = np.round(roll / _QUARTER).astype(int) % 4
    return np.bincount(quarters[ahead], minlength=4) / len(motion)


def _up_by_toes(pose: RigPose, foot: int, sign: int) -> Vector | None:
    """The side of a foot, in its axes, that its toes have up: the big toe is the inner one, and its
    root lies ahead of the little toe's. None where no toes fan out."""
    bone = pose.bone(foot)
    if bone is None:
        return None
    ahead = bone / np.linalg.norm(bone)
    for j in pose.skeleton.subtree(foot):
        roots = pose.positions[list(pose.skeleton.children[j])]
        if len(roots) not in _TOES:
            continue
        spread = quat_rotate(quat_conj(pose.world[foot]), roots - roots.mean(axis=0))
        level = spread - np.outer(spread @ ahead, ahead)
        along = level @ np.linalg.svd(level, full_matrices=False)[2][0]
        across = spread[np.argmax(along)] - spread[np.argmin(along)]
        stagger = float(across @ ahead)
        if abs(stagger) > _STAGGER * np.linalg.norm(across):
            return sign * np.sign(stagger) * np.cross(across, ahead)
    return None
