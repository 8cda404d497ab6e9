"""The floor of a motion without a source: where its feet stand."""

from dataclasses import replace

import numpy as np
import pytest

from sim.report import Subject, assess
from sim.report.course import course_of
from sim.report.floor import own_floor
from spark.motion import Motion
from spark.rotation import quat_from_yaw, quat_mul, quat_rotate
from tests.helpers.stick import standing, stick_rig

RIG = stick_rig()


def lifted(heights: np.ndarray, ahead: np.ndarray | float = 0.0) -> Motion:
    """A man who stands at `heights` [m], and so far `ahead` [m], frame by frame at 60 fps."""
    still = standing(RIG, len(heights))
    path = np.column_stack([ahead + 0.0 * heights, 0.0 * heights, heights])
    return replace(still, root_pos=still.root_pos + path)


def test_a_floor_is_where_feet_stand_and_not_where_they_dip() -> None:
    """In each second he goes 6 cm down for 0.1 s, as a toe does that pushes off."""
    dips = -0.06 * (np.arange(300) % 60 < 6)
    report = assess(Subject(lifted(dips), RIG))
    assert report.clip.floor_z == pytest.approx(0.0, abs=0.011)
    assert report.clip.shares["floating"] == 0.0
    assert report.clip.shares["penetration"] == pytest.approx(0.1, abs=0.01)


def test_what_the_lowest_points_explain_keeps_its_floor() -> None:
    heights = 0.03 * np.random.default_rng(0).random(300).cumsum() / 150
    lowest = course_of(Subject(lifted(heights), RIG)).lowest[:, 2]
    floor = own_floor(course_of(Subject(lifted(heights), RIG)))
    assert floor.floor_z == np.percentile(lowest, 5)
    assert floor.gradient == (0.0, 0.0)


def test_a_box_is_no_floor_though_he_stands_longer_on_it() -> None:
    report = assess(Subject(lifted(np.repeat([0.0, 0.3], [60, 240])), RIG))
    assert report.clip.floor_z == pytest.approx(0.0, abs=1e-9)
    assert report.clip.shares["penetration"] == 0.0


@pytest.mark.parametrize("yaw", [0.0, 2.0])
def test_a_floor_that_is_off_level_by_a_degree_is_that_slope(yaw: float) -> None:
    """Five places along a line that rises by 2 cm a metre, wherever it leads and begins."""
    place = np.repeat(np.arange(5), 60)
    motion = lifted(0.02 * place, 1.0 * place)
    turn = quat_from_yaw(np.array(yaw))
    rotations = motion.rotations.copy()
    rotations[:, 0] = quat_mul(turn, rotations[:, 0])
    root = quat_rotate(turn, motion.root_pos) + np.array([30.0, -20.0, 4.0])
    report = assess(Subject(replace(motion, rotations=rotations, root_pos=root), RIG))
    stands = np.arange(300) % 60 % 55 > 5
    np.testing.assert_allclose(report.clip.clearance[stands], 0.0, atol=2e-3)
    assert report.clip.shares["floating"] == 0.0
    assert any("taken to be that slope" in note for note in report.notes)


def test_a_ramp_is_not() -> None:
    place = np.repeat(np.arange(5), 60)
    report = assess(Subject(lifted(0.07 * place, 1.0 * place), RIG))
    assert report.clip.ground.gradient == (0.0, 0.0)
    assert report.clip.shares["floating"] > 0.5


@pytest.mark.parametrize("rise", [0.02, 0.0])
def test_beside_its_source_a_copy_is_on_its_slope_and_what_was_let_down_on_a_level(
    rise: float,
) -> None:
    place = np.repeat(np.arange(5), 60)
    source = Subject(lifted(0.02 * place, 1.0 * place), RIG)
    report = assess(Subject(lifted(rise * place, 1.0 * place), RIG), source=source)
    stands = np.arange(300) % 60 % 55 > 5
    assert report.source is not None
    for clip in (report.clip, report.source):
        np.testing.assert_allclose(clip.clearance[stands], 0.0, atol=2e-3)
    assert report.contacts is not None
    assert report.contacts.f1 == pytest.approx(1.0, abs=0.01)


def test_a_copy_that_floats_over_the_slope_of_its_source_is_told() -> None:
    place = np.repeat(np.arange(5), 60)
    source = Subject(lifted(0.02 * place, 1.0 * place), RIG)
    up = assess(Subject(lifted(0.06 + 0.02 * place, 1.0 * place), RIG), source=source)
    assert up.clip.flags["floating"][np.arange(300) % 60 % 55 > 5].all()


def test_who_copies_feet_that_stand_higher_than_they_dip_stands_as_its_source_does() -> None:
    dips = -0.06 * (np.arange(300) % 60 < 6)
    source = Subject(lifted(dips), RIG)
    report = assess(source, source=source)
    assert report.clip.shares["floating"] == 0.0
    assert report.clip.shares["penetration"] == pytest.approx(0.1, abs=0.01)
