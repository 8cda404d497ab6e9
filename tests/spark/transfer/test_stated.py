"""A motion on stated ground: its floor, what its feet stand on, and what is said of a misfit."""

from dataclasses import replace

import numpy as np
import pytest

from spark.errors import ConventionError
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.soles import sole_paths
from spark.transfer.stated import on_terrain
from spark.transfer.treads import treads_of
from tests.helpers.box import BOX, RIG, onto_box
from tests.helpers.grounds import box, profile, together

THERE = box((0.4, -0.5, 0.0), (1.4, 0.5, BOX))


def lifted(source: CanonicalMotion, up: float) -> CanonicalMotion:
    return replace(source, hips=source.hips + np.array([0.0, 0.0, up]), floor_z=source.floor_z + up)


def test_feet_stand_as_high_as_the_box_and_not_as_they_are_drawn() -> None:
    """Drawn 3 cm too low on the box, they stand on its top all the same."""
    source = on_terrain(onto_box(BOX - 0.03), THERE)
    treads = treads_of(source)
    assert treads.stands[95:145].all()
    np.testing.assert_allclose(treads.heights[95:145], BOX, atol=1e-6)
    np.testing.assert_allclose(treads.heights[:55], 0.0, atol=1e-6)
    assert treads.ground(0.0).terrain is THERE


def test_the_body_is_as_high_over_the_box_as_over_its_own_soles() -> None:
    right, low = (on_terrain(onto_box(height), THERE) for height in (BOX, BOX - 0.03))
    stands = slice(105, 135)  # where it is not on its way from the floor's height to the box's
    np.testing.assert_allclose(low.hips[stands, 2], right.hips[stands, 2], atol=0.012)


def test_the_floor_is_the_files_where_feet_stand_near_it() -> None:
    source = on_terrain(lifted(onto_box(), 0.04), THERE)
    assert source.floor_z == 0.0
    np.testing.assert_allclose(source.hips[:20, 2].mean(), RIG.hip_height, atol=0.02)


def test_the_floor_is_the_terrains_base_where_feet_stand_near_that() -> None:
    shifted = THERE.placed(1.0, np.array([0.0, 0.0, -0.9]))
    assert on_terrain(lifted(onto_box(), -0.88), shifted).floor_z == pytest.approx(-0.9)


def test_who_is_on_the_table_all_the_time_has_the_floor_below_it() -> None:
    table = box((-2, -2, 0.0), (3, 2, 0.7))
    source = on_terrain(lifted(onto_box(0.0), 0.7), table)
    assert source.floor_z == 0.0
    np.testing.assert_allclose(treads_of(source).heights, 0.7, atol=1e-6)


def test_a_foot_over_a_slope_has_its_relief() -> None:
    ramp = profile(np.array([[-3.0, -0.6], [3.0, 0.6]]), 4.0)
    source = onto_box(0.0)
    source = replace(source, hips=source.hips + np.outer(source.hips[:, 0], [0, 0, 0.2]))
    treads = treads_of(on_terrain(source, ramp))
    assert treads.relief is not None
    length = np.diff(sole_paths(source)[1][30, 0, :, 0])[0]  # from heel to toe
    rise = np.diff(treads.relief[30, 0])[0]
    assert rise == pytest.approx(0.2 * length, abs=1e-6)
    assert rise > 0.02


def test_ground_that_is_nowhere_near_is_refused_with_what_would_fit() -> None:
    in_cm = THERE.placed(100.0, np.zeros(3))
    with pytest.raises(ConventionError, match=r"is .* m from the nearest step.*scaled by 0.01 "):
        on_terrain(onto_box(), in_cm)
    with pytest.raises(ConventionError, match=r"nearest step"):
        on_terrain(onto_box(), THERE.placed(1.0, np.array([30.0, 0, 0])))


def test_ground_that_the_source_is_inside_of_is_refused() -> None:
    with pytest.raises(ConventionError, match=r"is around the source.*scaled by 0.01 "):
        on_terrain(onto_box(), box((-50, -50, 0), (50, 50, 40)))


def test_soles_far_from_the_ground_are_told() -> None:
    assert not on_terrain(onto_box(), THERE).notes
    (note,) = on_terrain(
        lifted(onto_box(), -0.09), together(THERE, box((-2, -2, -0.1), (3, 2, 0)))
    ).notes
    assert "9 cm below the stated ground" in note


def test_ground_that_no_foot_stands_on_is_told() -> None:
    (note,) = on_terrain(onto_box(), THERE.placed(1.0, np.array([0.0, 2.0, 0.0]))).notes
    assert "no foot" in note
