"""Soles over z = 0: within what shoes can be, and whose they are."""

from dataclasses import replace

import pytest

from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rig.standing import on_zero, same_feet
from tests.helpers.stick import joint, scaled, stick_rig


def with_toes(ahead: float) -> Rig:
    """The stick man with toes so much [m] further ahead."""
    rig = stick_rig()
    offsets = rig.skeleton.offsets.copy()
    offsets[[joint(Role.LEFT_TOE), joint(Role.RIGHT_TOE)], 0] += ahead
    return replace(rig, skeleton=replace(rig.skeleton, offsets=offsets))


@pytest.mark.parametrize("size", [1.0, 0.5, 4.0])
def test_feet_are_the_same_in_any_size(size: float) -> None:
    other = scaled(stick_rig(), size)
    assert same_feet(stick_rig(), other)
    assert same_feet(with_toes(0.002), other)
    assert not same_feet(with_toes(0.004), other)
    assert not same_feet(other, with_toes(0.004))


@pytest.mark.parametrize(
    ("soles_z", "stands"),
    [(-0.02, False), (-0.004, True), (0.0, True), (0.03, True), (0.04, True), (0.05, False)],
)
@pytest.mark.parametrize("size", [1.0, 0.5])
def test_shoes_are_so_thick_and_nobody_stands_in_the_floor(
    soles_z: float, stands: bool, size: float
) -> None:
    assert on_zero(scaled(stick_rig(), size), size * soles_z) == stands
