"""Any tree of joints with any names is mapped soundly or refused."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from spark.errors import SkeletonError
from spark.motion import Motion
from spark.rig.groups import groups_of
from spark.rig.override import check_chains
from spark.rig.role_assignment import assign_roles
from spark.rig.roles import Role, RoleMap
from spark.rotation import quat_from_rotvec, quat_mul
from spark.skeleton import Skeleton
from tests.helpers.rigs import RIGS, build, walk

WORDS = """
    left right l r upper lower arm leg hand foot toe hip knee head neck spine Hips Shoulder wing
    front back twist finger 1 2 01 ankle 足 左 _ . : - tail root
    """

JOINT_NAMES = st.lists(st.sampled_from(WORDS.split()), min_size=1, max_size=4).map("".join)


def check_sound(skeleton: Skeleton, roles: RoleMap) -> None:
    check_chains(skeleton, roles)
    for role in Role:
        one = role in (Role.PELVIS, Role.LEFT_UPPER_LEG, Role.LEFT_LOWER_LEG, Role.RIGHT_LOWER_LEG)
        several = role in (Role.SPINE, Role.NECK)
        assert one <= len(roles.joints(role)) <= (99 if several else 1)
    assert all(0 <= c <= 1 for c in roles.confidence)
    assert all(roles.reasons)
    assert all(groups_of(skeleton, roles))


@settings(max_examples=150, deadline=None)
@given(
    names=st.lists(JOINT_NAMES, min_size=1, max_size=30),
    reach=st.integers(1, 6),
    seed=st.integers(0, 2**32 - 1),
    scale=st.sampled_from([0.0, 1e-9, 0.2, 1e6]),
    mirror=st.booleans(),
    frames=st.sampled_from([None, 0, 1, 3]),
)
def test_any_tree_is_mapped_soundly_or_refused(
    names: list[str], reach: int, seed: int, scale: float, mirror: bool, frames: int | None
) -> None:
    count = len(names)
    rng = np.random.default_rng(seed)
    parents = [-1, *(int(rng.integers(max(0, j - reach), j)) for j in range(1, count))]
    offsets = scale * rng.normal(size=(count, 3))
    if mirror:  # pairs of bones, as bodies have them
        offsets[2::2] = offsets[1:-1:2] * [1, -1, 1]
    skeleton = Skeleton(tuple(names), np.array(parents), offsets, np.arange(count) == 0)
    motion = None
    if frames is not None:
        rotations = quat_from_rotvec(rng.normal(size=(frames, count, 3)))
        motion = Motion(skeleton, 0.03, rng.normal(size=(frames, 3)), rotations)
    try:
        roles = assign_roles(skeleton, motion)
    except SkeletonError:
        return
    check_sound(skeleton, roles)


@settings(max_examples=100, deadline=None)
@given(
    convention=st.sampled_from(sorted(RIGS)),
    renamed=st.dictionaries(st.integers(0, 60), JOINT_NAMES, max_size=12),
    bent=st.integers(0, 2**32 - 1),
    moves=st.booleans(),
)
def test_misleading_names_never_give_an_unsound_map(
    convention: str, renamed: dict[int, str], bent: int, moves: bool
) -> None:
    skeleton, right = build(RIGS[convention])
    names = tuple(renamed.get(j, name) for j, name in enumerate(skeleton.names))
    skeleton = replace(skeleton, names=names)
    motion = walk(skeleton, right, frames=5)
    turns = quat_from_rotvec(np.random.default_rng(bent).normal(size=(1, len(names), 3)))
    motion = replace(motion, rotations=quat_mul(motion.rotations, turns))
    try:
        roles = assign_roles(skeleton, motion if moves else None)
    except SkeletonError:
        return
    check_sound(skeleton, roles)
