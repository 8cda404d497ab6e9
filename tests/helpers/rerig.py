"""The same motion on a file that was built otherwise: another rest pose, other local axes.

Both are one thing. A joint whose own axes are turned by `axes[j]` (`q_old_new`) has other offsets
and rotations, and the body moves as before. With the inverses of a pose's world rotations, that
pose becomes the rest pose. What was the T-pose `tpose` is then `quat_mul(tpose, axes)`.
"""

import numpy as np

from spark.kinematics import local_rotations, world_positions, world_rotations
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.rig.roles import LIMBS, Group, Role
from spark.rotation import (
    quat_conj,
    quat_from_matrix,
    quat_from_rotvec,
    quat_identity,
    quat_mul,
    quat_rotate,
)
from spark.skeleton import Skeleton


def rerig(motion: Motion, axes: np.ndarray) -> Motion:
    """`motion` with each joint's own axes turned."""
    skeleton = motion.skeleton
    back = quat_conj(axes)
    parents = skeleton.parents[1:]
    offsets = skeleton.offsets.copy()
    offsets[1:] = quat_rotate(back[parents], offsets[1:])
    ends = quat_rotate(back[skeleton.end_parents], skeleton.end_offsets)
    turned = Skeleton(
        skeleton.names,
        skeleton.parents,
        offsets,
        skeleton.translating,
        skeleton.end_parents,
        ends,
    )
    world = quat_mul(world_rotations(skeleton, motion.rotations), axes)
    translations = None
    if motion.translations is not None:
        translations = motion.translations.copy()
        translations[:, 1:] = quat_rotate(back[parents], translations[:, 1:])
    rotations = local_rotations(turned, world)
    return Motion(turned, motion.frame_time, motion.root_pos, rotations, translations)


def rest_in(rig: Rig, turns: dict[Role, list[float]], whole: list[float]) -> np.ndarray:
    """Axes for `rerig` that make a pose the rest pose: limbs turned from the T-pose.

    `turns` are rotation vectors [rad] about the T-pose's axes at the left side's joints, mirrored
    for the right; feet stay flat. `whole` turns the whole body.
    """
    local = quat_identity(np.zeros((len(rig.skeleton), 1)))
    for role, rotvec in turns.items():
        for side, mirror in (("left", [1, 1, 1]), ("right", [-1, 1, -1])):
            joint = rig.roles.require(Role(role.value.replace("left", side)))
            local[joint] = quat_from_rotvec(np.array(rotvec, dtype=np.float64) * mirror)
    pose = world_rotations(rig.skeleton, local)
    for foot in (Role.LEFT_FOOT, Role.RIGHT_FOOT):
        pose[list(rig.skeleton.subtree(rig.roles.require(foot)))] = [1, 0, 0, 0]
    pose = quat_mul(quat_from_rotvec(np.array(whole, dtype=np.float64)), quat_mul(pose, rig.tpose))
    return quat_conj(pose)


def along_x(rig: Rig, quarters: tuple[int, int]) -> np.ndarray:
    """Axes for `rerig` as LAFAN1 has them: X along every bone, the whole body a line at rest.

    `quarters` are the right angles by which the axes of arms and of legs are turned about X.
    """
    positions = world_positions(rig.skeleton, rig.tpose, np.zeros(3))
    world = quat_identity(np.zeros((len(rig.skeleton), 1)))
    above = rig.skeleton.ancestors(rig.pelvis)[1:]
    for j, role in enumerate(rig.roles.roles):
        parent = int(rig.skeleton.parents[j])
        if role is None:
            world[j] = world[parent] if parent >= 0 and j not in above else [1, 0, 0, 0]
            continue
        limb = next((group for group, roles in LIMBS.items() if role in roles), None)
        if limb is None:
            world[j] = _frame(np.array([0, 0, 1.0]), np.array([0, 1.0, 0]), 0)
        elif limb in (Group.LEFT_ARM, Group.RIGHT_ARM):
            out = np.array([0, 1.0 if limb is Group.LEFT_ARM else -1.0, 0])
            world[j] = _frame(out, np.array([0, 0, 1.0]), quarters[0])
        else:
            bone = np.array([0, 0, -1.0])
            if role in (Role.LEFT_TOE, Role.RIGHT_TOE):
                bone = np.array([1.0, 0, 0])
            elif role in (Role.LEFT_FOOT, Role.RIGHT_FOOT):
                toe = rig.roles.require(Role(role.value.replace("foot", "toe")))
                bone = positions[toe] - positions[j]
            world[j] = _frame(bone, np.array([0, 1.0, 0]), quarters[1])
    return quat_mul(quat_conj(rig.tpose), world)


def _frame(x: np.ndarray, z: np.ndarray, quarters: int) -> np.ndarray:
    x = x / np.linalg.norm(x)
    z = z - x * (x @ z)
    z = z / np.linalg.norm(z)
    R = np.stack([x, np.cross(z, x), z], axis=1)
    return quat_mul(quat_from_matrix(R), quat_from_rotvec(np.array([quarters * np.pi / 2, 0, 0])))


def with_nulls(motion: Motion, turns: np.ndarray) -> tuple[Motion, np.ndarray]:
    """`motion` with a null before each joint but the root, named as the joint with more behind it
    and turned by `turns[j]` against the joint above; and where the joints are now."""
    skeleton, count = motion.skeleton, len(motion.skeleton)
    at = np.array([0, *(2 * np.arange(1, count))])  # the null of joint at[j] is at[j] - 1
    size = 2 * count - 1
    names, parents = [""] * size, np.full(size, -1)
    offsets, translating = np.zeros((size, 3)), np.zeros(size, dtype=bool)
    rotations = quat_identity(np.zeros((len(motion), size, 1)))
    for j in range(count):
        names[at[j]], translating[at[j]] = skeleton.names[j], j == 0
        rotations[:, at[j]] = motion.rotations[:, j]
        if j == 0:
            offsets[0] = skeleton.offsets[0]
            continue
        null = at[j] - 1
        names[null] = f"{skeleton.names[j]}_$AssimpFbx$_PreRotation"
        parents[null], parents[at[j]] = at[skeleton.parents[j]], null
        offsets[null] = skeleton.offsets[j]
        rotations[:, null] = turns[j]
        rotations[:, at[j]] = quat_mul(quat_conj(turns[j]), motion.rotations[:, j])
    with_them = Skeleton(
        tuple(names),
        parents,
        offsets,
        translating,
        at[skeleton.end_parents],
        skeleton.end_offsets,
    )
    return Motion(with_them, motion.frame_time, motion.root_pos, rotations), at
