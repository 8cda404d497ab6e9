"""A character stands on its own soles where its source stands on z = 0, and only there."""

from dataclasses import replace

import numpy as np
import pytest

from spark.rig.rig import Rig
from spark.transfer.analytic import transfer
from spark.transfer.canonical import CanonicalMotion, to_canonical
from spark.transfer.leg_fit import fit_legs
from spark.transfer.own_soles import fit_body
from spark.transfer.refine import refined
from spark.transfer.soles import lowest_soles
from tests.helpers.proportions import built
from tests.helpers.stick import scaled, standing, stick_rig

SHOES = 0.027  # [m] 3 % of the stick man's hip height
UP = np.array([0.0, 0.0, 1.0])
OTHER_FEET = (built(foot=1.2), scaled(built(foot=0.8), 0.5))


def stood(rig: Rig, higher: float = SHOES) -> CanonicalMotion:
    """A body that stands, its soles so high [m] over z = 0."""
    still = standing(rig, 40)
    return to_canonical(replace(still, root_pos=still.root_pos + higher * UP), rig)


def assert_same(one: CanonicalMotion, other: CanonicalMotion) -> None:
    np.testing.assert_array_equal(one.hips, other.hips)
    np.testing.assert_array_equal(one.rotations, other.rotations)
    assert one.floor_z == other.floor_z


@pytest.mark.parametrize("rig", OTHER_FEET)
@pytest.mark.parametrize("higher", [0.0, SHOES])
def test_soles_are_as_high_as_usual_whatever_the_source_wears(rig: Rig, higher: float) -> None:
    source = stood(stick_rig(), higher)
    made = refined(source, fit_body(source, transfer(source, rig)))
    np.testing.assert_allclose(lowest_soles(made), 0.01 * rig.hip_height, atol=1e-3)
    assert made.floor_z == pytest.approx(0.01 * rig.hip_height)


@pytest.mark.parametrize("rig", OTHER_FEET)
@pytest.mark.parametrize(("recorded", "own"), [(0.02, 0.02), (-0.004, 0.0), (0.04, 0.035)])
def test_soles_are_as_high_as_in_a_recording_of_its_own(
    rig: Rig, recorded: float, own: float
) -> None:
    source, size = stood(stick_rig()), rig.hip_height
    moved = fit_body(source, transfer(source, rig), stood(rig, recorded * size))
    np.testing.assert_allclose(lowest_soles(refined(source, moved)), own * size, atol=1e-3)


def test_a_recording_that_hovers_tells_nothing() -> None:
    source, rig = stood(stick_rig()), OTHER_FEET[0]
    moved = transfer(source, rig)
    assert_same(fit_body(source, moved, stood(rig, 0.2)), fit_body(source, moved))


def test_the_same_feet_stand_on_the_same_soles() -> None:
    source, rig = stood(stick_rig()), scaled(stick_rig(), 0.5)
    moved = transfer(source, rig)
    assert_same(fit_body(source, moved, stood(rig, 0.0)), fit_legs(source, moved))


@pytest.mark.parametrize("higher", [-0.02, 0.06, 0.2])
def test_a_source_that_hovers_or_sinks_is_left_alone(higher: float) -> None:
    source = stood(stick_rig(), higher)
    moved = transfer(source, OTHER_FEET[0])
    assert_same(fit_body(source, moved), fit_legs(source, moved))


@pytest.mark.parametrize("climb", [0.02, -0.02])
def test_a_source_that_stands_on_two_heights_is_left_alone(climb: float) -> None:
    low = stood(stick_rig())
    hips = low.hips + np.where(np.arange(len(low)) < 20, 0.0, climb)[:, None] * UP
    source = replace(low, hips=hips, floor_z=low.floor_z + min(climb, 0.0))
    moved = transfer(source, OTHER_FEET[0])
    assert_same(fit_body(source, moved), fit_legs(source, moved))
