"""Rigs named as the ecosystem names them."""

import pytest

from spark.rig.name_conventions import CONVENTIONS, name_joints
from spark.rig.roles import Role


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_conventions_name_every_joint_apart(convention: str) -> None:
    roles = [Role.PELVIS, Role.SPINE, Role.SPINE, Role.NECK, *list(Role)[3:]]
    names = name_joints(roles, convention)
    assert len(set(names)) == len(names)
