"""Feet that stand are level from side to side."""

from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import Float

from robots.kinematics import forward_kinematics
from robots.registry import find
from robots.solver.floor import sole_paths
from robots.solver.level_feet import level_across
from robots.solver.solve import retarget
from robots.solver.targets import targets_of
from spark.demo.sample import sample_motion, sample_rig
from spark.rig.roles import Role
from spark.rotation import (
    quat_conj,
    quat_from_rotvec,
    quat_from_yaw,
    quat_mul,
    quat_rotate,
)
from spark.transfer.canonical import CanonicalMotion, to_canonical
from spark_sim.loading import load_robot


def turned(roll: float, pitch: float, count: int) -> Float[np.ndarray, "T 4"]:
    """A foot that heads somewhere, and is pitched and then rolled about itself [rad]."""
    pitched = quat_mul(quat_from_yaw(np.full(count, 2.0)), quat_from_rotvec(pitch * np.eye(3)[1:2]))
    return quat_mul(pitched, quat_from_rotvec(roll * np.eye(3)[:1]))


@pytest.mark.parametrize("degrees", [-7.0, 7.0, 20.0])
@pytest.mark.parametrize("pitch", [0.0, 0.6])
def test_a_foot_that_stands_is_level_across_and_points_where_it_did(
    degrees: float, pitch: float
) -> None:
    """It stands rolled, is rolled by 0.3 rad more in the air, and back."""
    tpose, roll = quat_from_rotvec(np.array([[0.3, -0.5, 0.2]])), np.radians(degrees)
    flat = np.arange(60) % 30 < 20
    since = np.where(flat[:, None], turned(roll, pitch, 60), turned(roll + 0.3, pitch, 60))
    found = quat_mul(level_across(quat_mul(since, tpose), tpose[0], flat), quat_conj(tpose))
    ahead, left = np.eye(3)[:1], np.eye(3)[1:2]
    np.testing.assert_allclose(quat_rotate(found, ahead), quat_rotate(since, ahead), atol=1e-12)
    np.testing.assert_allclose(quat_rotate(found, left)[flat, 2], 0.0, atol=1e-12)
    away = np.sin(0.3) * np.cos(pitch)
    np.testing.assert_allclose(quat_rotate(found, left)[~flat, 2], away, atol=1e-12)


def test_a_foot_that_wobbles_is_not_levelled_by_where_it_tips_over() -> None:
    """It is level in most frames, and tips to one side in some; or stands nowhere."""
    tpose = np.array([1.0, 0.0, 0.0, 0.0])
    world = np.concatenate([turned(0.0, 0.0, 20), turned(0.5, 0.0, 10)])
    for flat in (np.ones(30, dtype=bool), np.zeros(30, dtype=bool)):
        np.testing.assert_allclose(level_across(world, tpose, flat), world, atol=1e-12)


def rolled(walk: CanonicalMotion, degrees: float) -> CanonicalMotion:
    """With feet that are rolled outwards all the while, as of a skeleton with another rest pose."""
    rotations = walk.rotations.copy()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        j = walk.rig.roles.require(Role(f"{side}_foot"))
        roll = quat_from_rotvec(np.array([[sign * np.radians(degrees), 0.0, 0.0]]))
        rotations[:, j] = quat_mul(rotations[:, j], roll)
    return replace(walk, rotations=rotations)


def test_a_robot_stands_on_both_edges_of_its_soles() -> None:
    """A walk in which both feet roll by 8 degrees: the robot's would be 2 mm higher on one side."""
    rig = sample_rig("walker")
    ember = load_robot(find("robot")).on_robot.robot
    walk = rolled(to_canonical(sample_motion("walk", rig, 60.0), rig).frames(0, 90), 8.0)
    stands = np.all(targets_of(walk, ember).contacts, axis=2)
    result = retarget(walk, ember)
    poses = forward_kinematics(ember.tree, result.coordinates)
    for s, sole in enumerate(ember.soles):
        heights = sole_paths(ember, poses, sole)[stands[:, s], :, 2]
        assert len(heights) > 20
        assert np.abs(heights[:, 0] - heights[:, 1]).mean() < 5e-4
