"""Joints that follow others: where their leaders take them, and nothing else is given up for it."""

from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest

from robots.model.followers import Follower, led_by
from robots.model.known import known
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.solver.solve import copy, retarget
from scripts.robot_bars import follow
from sim.report.clip_poses import pose_clip
from sim.trajectory import Subject
from spark.demo.sample import sample_motion, sample_rig
from spark.transfer.canonical import CanonicalMotion, to_canonical
from tests.helpers.ember import changed_ember

Way = Callable[[CanonicalMotion, Morphology], RobotMotion]

# Of one motor each: the yaw of both hips, as a NAO's, and two hinges of the waist.
PAIRS = {"right_hip_yaw": ("left_hip_yaw", -1.0), "waist_roll": ("waist_yaw", 0.5)}


def coupled(folder: Path, pairs: dict[str, tuple[str, float]]) -> Morphology:
    """Ember with some hinges that turn by so much of others."""
    rows = "".join(
        f'<joint joint1="{follower}" joint2="{leader}" polycoef="0 {rate} 0 0 0"/>'
        for follower, (leader, rate) in pairs.items()
    )
    return changed_ember(folder, "</worldbody>", f"</worldbody><equality>{rows}</equality>")


@pytest.fixture(scope="module")
def walk() -> CanonicalMotion:
    rig = sample_rig("walker")
    return to_canonical(sample_motion("walk", rig, 60.0).frames(0, 120), rig)


@pytest.mark.parametrize("way", [copy, retarget, follow], ids=["copy", "whole", "stream"])
def test_followers_are_where_their_leaders_take_them(
    way: Way, walk: CanonicalMotion, tmp_path: Path
) -> None:
    robot = coupled(tmp_path, PAIRS)
    result = way(walk, robot)
    angles = dict(zip(robot.joint_names, result.coordinates.angles.T, strict=True))
    assert np.ptp(angles["left_hip_yaw"]) > 0.01
    for follower, (leader, rate) in PAIRS.items():
        np.testing.assert_allclose(angles[follower], rate * angles[leader], atol=1e-9)


@pytest.mark.parametrize("way", [retarget, follow], ids=["whole", "stream"])
def test_what_follows_is_solved_for_and_not_overwritten(
    way: Way, walk: CanonicalMotion, tmp_path: Path
) -> None:
    """A hinge that is set afterwards takes its foot off the ground, or into it."""
    robot = coupled(tmp_path, {"right_hip_pitch": ("left_hip_pitch", -0.8)})
    result = way(walk, robot)
    parts = pose_clip(Subject(result.motion, robot.rig, result.body))
    lowest = (parts.part_points[..., 2] - parts.part_radii).min(axis=1)
    assert np.abs(lowest).max() < 0.02


def test_a_leader_that_moves_nothing_is_led(walk: CanonicalMotion, tmp_path: Path) -> None:
    """A motor beside the leg drives the knee: the knee bends, and the motor turns with it."""
    crank = (
        '<body name="crank"><joint name="motor" axis="0 1 0" range="-3 3"/>'
        '<geom size="0.01" mass="0.01"/></body><body name="left_shin"'
    )
    rows = '<joint joint1="left_knee" joint2="motor" polycoef="0.1 -2 0 0 0"/>'
    robot = changed_ember(
        tmp_path,
        r'<body name="left_shin"|</worldbody>',
        lambda at: crank if "left_shin" in at[0] else f"{at[0]}<equality>{rows}</equality>",
    )
    angles = retarget(walk, robot).coordinates.angles
    knee, motor = (angles[:, robot.joint_names.index(name)] for name in ("left_knee", "motor"))
    assert np.ptp(knee) > 0.5
    np.testing.assert_allclose(knee, 0.1 - 2.0 * motor, atol=1e-9)


def test_who_follows_a_led_leader_follows_its_limb() -> None:
    def line(joint: int, leader: int, a: float, b: float) -> Follower:
        return Follower(joint, leader, np.array([a, b, 0.0, 0.0, 0.0]))

    found = led_by([line(0, 5, 0.2, 2.0), line(1, 5, 0.0, -1.0), line(6, 5, 0.0, 3.0)], {0, 1})
    angles = np.zeros((1, 7))
    angles[:, 0] = 0.7
    for follower in found:
        angles[:, follower.joint] = follower.angle(angles)
    np.testing.assert_allclose(angles[0, [5, 1, 6]], [0.25, -0.25, 0.75])
    assert {(f.joint, f.leader) for f in found} == {(5, 0), (1, 0), (6, 0)}


def test_the_t_pose_keeps_to_it(tmp_path: Path) -> None:
    robot = coupled(tmp_path, {"right_elbow": ("left_elbow", 1.0), "left_elbow": ("waist_yaw", 1)})
    tpose = dict(zip(robot.joint_names, robot.tpose.angles[0], strict=True))
    assert tpose["right_elbow"] == tpose["left_elbow"] == tpose["waist_yaw"]


def test_the_gradient_is_that_of_the_residual() -> None:
    follower = Follower(1, 0, np.array([0.1, 0.5, -0.3, 0.2, 0.05]))
    angles, step = np.array([[0.4, -0.7]]), 1e-6
    J, residual = follower.residual(angles, 3.0)
    for column, joint in enumerate((1, 0)):
        moved = angles.copy()
        moved[:, joint] += step
        numeric = (follower.residual(moved, 3.0)[1] - residual) / step
        np.testing.assert_allclose(J[:, column], numeric, atol=1e-4)


def test_followers_are_mujocos(tmp_path: Path) -> None:
    """Where they are, MuJoCo finds its constraints kept."""
    robot = coupled(tmp_path, PAIRS)
    q = robot.following(known("robot").tpose)
    data = mujoco.MjData(robot.mjcf.model)
    data.qpos = robot.to_qpos(q)[0]
    mujoco.mj_forward(robot.mjcf.model, data)
    kept = data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    assert kept.sum() == len(PAIRS)
    np.testing.assert_allclose(data.efc_pos[kept], 0.0, atol=1e-9)
