"""Bodies beside the one that a rig is of: several people recorded into one tree of joints.

Formats hold one root, so programs put a second body beside the first, under a joint of the scene.
"""

from itertools import pairwise

import numpy as np

from spark.errors import SkeletonError
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.role_assignment import assign_roles
from spark.rig.roles import Role, RoleMap
from spark.skeleton import Skeleton

_FRAMES = 32  # of a motion that are looked at
_FEWEST = 10  # joints of a body: knees, elbows and both ends of each
_LIMBS = (Role.LEFT_UPPER_LEG, Role.RIGHT_UPPER_LEG, Role.LEFT_UPPER_ARM, Role.RIGHT_UPPER_ARM)
_APART = 0.1  # of its thigh. Rigs of control bones have a body over again, in the same place


def other_bodies(motion: Motion, roles: RoleMap) -> tuple[int, ...]:
    """The topmost joint of each body beside the one whose joints hold `roles`: a branch beside that
    body, with two legs and two arms of its own, that stands elsewhere."""
    skeleton = motion.skeleton
    lines = [skeleton.ancestors(j)[::-1] for j in roles.held]
    above = [together[0] for together in zip(*lines, strict=False) if len({*together}) == 1]
    branches = [
        branch
        for joint, own in pairwise(above)
        for child in skeleton.children[joint]
        if child != own and len(branch := skeleton.subtree(child)) >= _FEWEST
    ]
    if not branches:
        return ()
    motion = motion.thinned(_FRAMES)
    return tuple(branch[0] for branch in branches if _is_other(motion, roles, branch))


def _is_other(motion: Motion, roles: RoleMap, branch: tuple[int, ...]) -> bool:
    alone = _alone(motion, branch)
    try:
        found = assign_roles(alone.skeleton, alone)
    except SkeletonError:
        return False
    if any(found.joint(role) is None for role in _LIMBS):
        return False
    positions, _ = forward(motion)
    hip, knee = (roles.require(r) for r in (Role.LEFT_UPPER_LEG, Role.LEFT_LOWER_LEG))
    thigh = np.linalg.norm(positions[:, knee] - positions[:, hip], axis=-1)
    apart = positions[:, branch[found.require(Role.LEFT_UPPER_LEG)]] - positions[:, hip]
    return bool(np.median(np.linalg.norm(apart, axis=-1)) > _APART * np.median(thigh))


def _alone(motion: Motion, branch: tuple[int, ...]) -> Motion:
    """The motion of a branch of the tree, by itself, where it is in the world."""
    skeleton, joints = motion.skeleton, [*branch]
    positions, world = forward(motion)
    places = {joint: k for k, joint in enumerate(branch)}
    ends = np.isin(skeleton.end_parents, joints)
    rotations = motion.rotations[:, joints]
    rotations[:, 0] = world[:, branch[0]]
    return Motion(
        Skeleton(
            tuple(skeleton.names[j] for j in branch),
            np.array([places.get(int(skeleton.parents[j]), -1) for j in branch]),
            skeleton.offsets[joints],
            skeleton.translating[joints],
            np.array([places[int(j)] for j in skeleton.end_parents[ends]], dtype=np.int64),
            skeleton.end_offsets[ends],
        ),
        motion.frame_time,
        positions[:, branch[0]],
        rotations,
        None if motion.translations is None else motion.translations[:, joints],
    )
