"""The six parts of a body."""

import pytest

from spark.rig.groups import groups_of
from spark.rig.role_assignment import assign_roles
from spark.rig.roles import LIMBS, Group, Role
from tests.helpers.rigs import RIGS, build


def test_groups_share_the_hips_and_the_chest() -> None:
    skeleton, _ = build(RIGS["vicon"])
    groups = groups_of(skeleton, assign_roles(skeleton))
    of = dict(zip(skeleton.names, groups, strict=True))
    arms = {Group.LEFT_ARM, Group.RIGHT_ARM}
    assert of["root"] == {Group.TORSO, Group.LEFT_LEG, Group.RIGHT_LEG}
    assert of["thorax"] == {Group.TORSO, Group.HEAD} | arms
    assert of["lowerback"] == of["upperback"] == {Group.TORSO}
    assert of["lowerneck"] == of["head"] == {Group.HEAD}
    assert of["lhipjoint"] == of["ltoes"] == {Group.LEFT_LEG}
    assert of["rclavicle"] == of["rthumb"] == {Group.RIGHT_ARM}


@pytest.mark.parametrize("convention", RIGS)
def test_every_joint_has_a_group_and_every_group_the_joint_it_hangs_on(convention: str) -> None:
    skeleton, _ = build(RIGS[convention])
    roles = assign_roles(skeleton)
    groups = groups_of(skeleton, roles)
    assert all(groups)
    shared = [j for j, own in enumerate(groups) if len(own) > 1]
    assert set(shared) == {
        roles.require(Role.PELVIS),
        *(roles.joints(Role.SPINE) or roles.joints(Role.PELVIS))[-1:],
    }
    for group, limb in LIMBS.items():
        held = [j for role in limb for j in roles.joints(role)]
        assert all(groups[j] == {group} for j in held)
