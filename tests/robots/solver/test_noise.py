"""A robot's feet stand where those of a trembling recording would."""

import numpy as np
import pytest

from robots.model.known import known
from robots.solver.solve import retarget
from robots.solver.targets import targets_of
from sim.report.measures import contact_match
from spark.rotation import quat_angle
from spark.transfer.noise import without_noise
from tests.helpers.shaken import demo_clip


@pytest.mark.parametrize(("degrees", "least"), [(1.0, 0.93), (2.0, 0.85)])
def test_a_noisy_walk_stands_where_the_clean_one_does(degrees: float, least: float) -> None:
    robot, clean, shaken = (
        known("robot"),
        demo_clip("walk", 30.0),
        demo_clip("walk", 30.0, degrees),
    )
    truth = targets_of(clean, robot).contacts.reshape(len(clean), -1)
    quiet, noise, (note,) = without_noise(shaken)
    found = targets_of(quiet, robot, noise).contacts.reshape(truth.shape)
    f1 = contact_match(found, truth).f1
    assert f1 is not None
    assert f1 > least
    missed = contact_match(targets_of(shaken, robot).contacts.reshape(truth.shape), truth).f1
    assert missed is not None
    assert missed < 0.6
    before, after = (
        np.sqrt((quat_angle(own.rotations, clean.rotations) ** 2).mean()) for own in (shaken, quiet)
    )
    assert after < 0.6 * before
    assert abs(quiet.floor_z - clean.floor_z) < 0.01 * degrees
    assert "tremble" in note


def test_a_robot_says_that_it_follows_a_smoothed_recording() -> None:
    moved = retarget(demo_clip("walk", 30.0, 1.0).frames(0, 30), known("robot"))
    assert any("tremble" in note for note in moved.notes)
