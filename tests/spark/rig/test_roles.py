"""Sides and parts of roles."""

import pytest

from spark.rig.roles import Role


@pytest.mark.parametrize("role", Role)
def test_a_roles_side_and_part_make_its_name_again(role: Role) -> None:
    assert "_".join(filter(None, (role.side, role.part))) == role.value
    assert role.side in ("", "left", "right")
    assert role.mirrored.mirrored is role
    assert (role.mirrored is role) == (role.side == "")
    assert role.mirrored.part == role.part
