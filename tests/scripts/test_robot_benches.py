"""The benches of robots: their corruptions do what they say, and a standing robot is balanced."""

import numpy as np
import pytest

from robots import registry
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.model.understand import understand_robot
from scripts.balance_qp import Balance
from scripts.climb_bench import climbed
from scripts.robot_report_bench import CORRUPTIONS
from spark.rig.feet import sole_positions


@pytest.fixture(scope="module")
def standing() -> RobotMotion:
    """Ember in its T-pose, its soles on the floor, for a second."""
    robot: Morphology = understand_robot(registry.find("robot"))
    qpos = np.tile(robot.to_qpos(robot.tpose)[0], (61, 1))
    soles = [sole_positions(s, robot.rig.tpose_positions, robot.rig.tpose) for s in robot.rig.soles]
    lowest = np.concatenate(soles)[:, 2].min()
    qpos[:, 2] += -lowest - robot.motion(robot.from_qpos(qpos[:1]), 1.0).root_pos[0, 2]
    return RobotMotion(robot, robot.from_qpos(qpos), 1 / 60)


def spoilt(kind: str, motion: RobotMotion) -> RobotMotion:
    return CORRUPTIONS[kind](motion, np.random.default_rng(0))


def test_the_base_moves_as_told(standing: RobotMotion) -> None:
    scale = standing.robot.rig.hip_height / 0.9
    for kind, height in (("float 5 cm", 0.05), ("sink 3 cm", -0.03)):
        moved = spoilt(kind, standing).qpos - standing.qpos
        np.testing.assert_allclose(moved[:, :3], [[0, 0, height * scale]] * 61, atol=1e-9)
        np.testing.assert_allclose(moved[:, 3:], 0, atol=1e-9)
    moved = spoilt("slide 0.3 m/s", standing).qpos - standing.qpos
    way = np.linalg.norm(moved[:, :2], axis=1)
    np.testing.assert_allclose(way, 0.3 * np.arange(61) / 60, atol=1e-9)


def test_hinges_move_within_their_ranges(standing: RobotMotion) -> None:
    tree, still = standing.robot.tree, standing.coordinates.angles
    for kind, size in (("jitter 2°", 2.0), ("flail 10°", 10 / np.sqrt(2))):
        angles = spoilt(kind, standing).coordinates.angles
        assert (angles >= tree.lower - 1e-9).all()
        assert (angles <= tree.upper + 1e-9).all()
        free = (still > tree.lower + 0.4) & (still < tree.upper - 0.4)
        rms = np.degrees(np.sqrt(((angles - still)[free] ** 2).mean()))
        assert rms == pytest.approx(size, rel=0.05)


def test_one_hinge_of_an_arm_is_thrown_once_a_second(standing: RobotMotion) -> None:
    still = standing.coordinates.angles
    away = np.degrees(np.abs(spoilt("arm thrown 15°", standing).coordinates.angles - still))
    (hinge,) = np.flatnonzero(away.any(axis=0))
    assert "left_shoulder" in standing.robot.joint_names[hinge]
    assert away[6, hinge] == pytest.approx(15)
    assert away[12:60].max() == pytest.approx(0, abs=1e-9)


def test_other_frame_rates_are_the_same_motion(standing: RobotMotion) -> None:
    for kind, count in (("30 fps", 31), ("120 fps", 121)):
        other = spoilt(kind, standing)
        assert len(other) == count
        np.testing.assert_allclose(other.qpos, standing.qpos[:1].repeat(count, 0), atol=1e-9)
    assert spoilt("twice as fast", standing).frame_time == standing.frame_time / 2


def test_a_standing_robot_is_balanced_by_its_own_forces(standing: RobotMotion) -> None:
    balance = Balance(standing)
    assert balance.run() == balance.times[-1]
    # It stands where it stood, and not by luck: without its torques it gives way.
    assert np.abs(balance.data.qpos - balance.q[-1]).max() < 0.02
    limp = Balance(standing)
    limp.limits[:] = 0.0
    limp.run()
    assert np.abs(limp.data.qpos - limp.q[-1]).max() > 0.2


@pytest.mark.parametrize("top", [0.03, -0.05])
def test_a_box_is_as_deep_under_a_foot_as_it_is(standing: RobotMotion, top: float) -> None:
    """Under the left foot alone, its top so high [m] over where that stands."""
    robot, lift = standing.robot, 0.5
    qpos = standing.qpos + np.eye(standing.qpos.shape[1])[2] * lift
    corners = np.array([[x, y, z] for x in (-0.3, 0.3) for y in (0.01, 0.4) for z in (0.0, 1.0)])
    box = corners * [1, 1, lift + top]
    climb = climbed(robot, robot.from_qpos(qpos), [box], standing.frame_time)
    sides = [sole.side for sole in robot.soles]
    np.testing.assert_allclose(climb.over[:, sides.index("left")], -top, atol=1e-6)
    np.testing.assert_allclose(climb.over[:, sides.index("right")], lift, atol=1e-6)
    np.testing.assert_allclose(climb.feet, max(top, 0.0), atol=1e-6)
    assert (climb.others <= climb.feet).all()  # an ankle, too, is in a box that is high enough
    np.testing.assert_allclose(climb.speed, 0.0, atol=1e-9)
