"""Where feet stand, and how: as far as the robot can."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from robots.registry import find
from robots.solver.footprints import MAX_TWIST, headings, on_prints, plan_feet, reachable
from robots.solver.targets import targets_of
from spark.demo.sample import sample_motion, sample_rig
from spark.rig.roles import Role
from spark.rotation import quat_from_yaw, quat_mul, quat_rotate
from spark.transfer.canonical import canonical_positions, to_canonical
from spark_sim.loading import load_robot


def test_soles_roll_as_far_as_the_robots_do() -> None:
    """A walk whose wanted soles roll by 20 degrees, on a robot whose soles stay level: each end is
    as high as wanted, and level."""
    rig = sample_rig("walker")
    ember = load_robot(find("robot")).on_robot.robot
    walk = to_canonical(sample_motion("walk", rig, 60.0), rig)
    plans = plan_feet(ember, targets_of(walk, ember))
    for plan in plans:
        across = plan.points[:, 0::2, :2] - plan.points[:, 1::2, :2]
        roll = np.tan(np.radians(20)) * np.linalg.norm(across, axis=-1) / 2
        plan.points[:, 0::2, 2] += roll
        plan.points[:, 1::2, 2] -= roll
    level = ember.tpose.at(np.zeros(len(plans[0].toe), dtype=int))
    for plan, found in zip(plans, reachable(ember, plans, level), strict=True):
        ends, wanted = (p.points[..., 2].reshape(len(p.toe), -1, 2) for p in (found, plan))
        assert np.ptp(wanted, axis=2).min() > 0.01
        np.testing.assert_allclose(np.ptp(ends, axis=2), 0.0, atol=1e-6)
        np.testing.assert_allclose(ends.mean(axis=2), wanted.mean(axis=2), atol=1e-9)
        np.testing.assert_array_equal(found.points[..., :2], plan.points[..., :2])


def test_a_foot_spins_on_what_carries_it() -> None:
    """A body that stands, and turns by half a turn about its left ankle: the footprint goes
    with the copied sole."""
    rig = sample_rig("walker")
    ember = load_robot(find("robot")).on_robot.robot
    still = to_canonical(sample_motion("walk", rig, 60.0), rig).frames(0, 40)
    first = still.frames(0, 1)
    ankle = canonical_positions(first)[0, rig.roles.require(Role.LEFT_FOOT)] * [1, 1, 0]
    turn = quat_from_yaw(np.linspace(0, np.pi, len(still)))
    spin = replace(
        still,
        rotations=quat_mul(turn[:, None], np.broadcast_to(first.rotations, still.rotations.shape)),
        hips=ankle + quat_rotate(turn, first.hips - ankle),
    )
    plan = plan_feet(ember, targets_of(spin, ember))[0]
    assert plan.stands.all()
    assert np.ptp(plan.prints[:, 2]) > 0.8 * np.pi
    pivot, heading = plan.prints[:, 0] + 1j * plan.prints[:, 1], plan.prints[:, 2]
    copied = plan.points[..., 0] + 1j * plan.points[..., 1]
    away = np.abs(on_prints(plan.flat, pivot, heading) - copied)
    assert away.max() < 0.06  # within a wobble; a spin on the toes is 0.2 m away


def test_a_foot_whose_toe_is_up_turns_about_its_heel() -> None:
    """A body that stands, and whose toes then leave the floor while it turns by 50 degrees: the
    print turns along, but for what is a wobble, and its heel stays."""
    rig = sample_rig("walker")
    ember = load_robot(find("robot")).on_robot.robot
    still = to_canonical(sample_motion("walk", rig, 60.0), rig).frames(0, 40)
    targets = targets_of(still, ember)
    up = np.arange(40) >= 20
    turn = np.radians(50) * np.clip((np.arange(40) - 20) / 19, 0.0, 1.0)
    world = quat_mul(quat_from_yaw(turn)[:, None], np.repeat(targets.world[:1], 40, axis=0))
    contacts = np.ones((40, 2, 2), dtype=bool)
    contacts[up, :, 1] = False
    hips, feet = (np.repeat(x[:1], 40, axis=0) for x in (targets.hips, targets.feet))
    turning = replace(targets, world=world, contacts=contacts, hips=hips, feet=feet)
    for plan in plan_feet(ember, turning):
        heading = plan.prints[:, 2]
        np.testing.assert_allclose(heading[-1] - plan.heading[-1], -MAX_TWIST, atol=1e-6)
        heel = plan.prints[:, :2] - plan.length * np.stack([np.cos(heading), np.sin(heading)], 1)
        assert np.ptp(heel[up], axis=0).max() < 1e-9
        assert np.ptp(plan.prints[~up, :2], axis=0).max() < 1e-9


def test_a_sole_on_end_heads_where_it_would_if_it_lay_flat() -> None:
    """A foot that heads by 0.3 rad and is pitched to and beyond the vertical, or rolled."""
    flat = np.array([[0, -0.04, 0], [0, 0.04, 0], [0.2, -0.05, 0], [0.2, 0.05, 0]])
    for pitch, roll in ((0, 0), (-50, 0), (-89, 0), (-100, 0), (0, 30)):
        tipped = Rotation.from_euler("ZYX", [0.3, np.radians(-pitch), np.radians(roll)])
        heading = headings(tipped.apply(flat)[None])
        assert heading == pytest.approx(0.3, abs=1e-6)
