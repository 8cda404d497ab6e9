"""The controller that looks ahead: what servos let fall stays up."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.solver.solve import retarget
from sim.physics.balance import beforehand
from sim.physics.servos import servo_model, servo_spec
from sim.physics.summary import render, summarize
from sim.physics.tracking import TrackingResult, track
from sim.report.assess import assess
from sim.trajectory import Subject
from spark.demo.sample import sample_motion, sample_rig
from spark.transfer.canonical import to_canonical

FPS = 60.0
SECONDS = 1.4  # of a walk: servos alone let Ember fall before that


@pytest.fixture(scope="module")
def walk(ember: Morphology) -> RobotMotion:
    rig = sample_rig("walker")
    motion = sample_motion("walk", rig, FPS).frames(0, 1 + round(SECONDS * FPS))
    return retarget(to_canonical(motion, rig), ember)


def follow(walk: RobotMotion, *, balance: bool, frames: int | None = None) -> TrackingResult:
    part = replace(walk.body, qpos=walk.body.qpos[:frames])
    robot = walk.robot
    needed = assess(Subject(walk.motion, robot.rig, walk.body)).clip.torque_by_joint
    torques = {joint: torque[:frames] for joint, torque in needed.items()}
    height = robot.rig.standing_height
    return track(part, walk.frame_time, height=height, balance=balance, torques=torques)


def test_a_walk_that_servos_let_fall_stays_up(walk: RobotMotion) -> None:
    assert summarize(follow(walk, balance=False))["verdict"] == "falls"
    found = summarize(follow(walk, balance=True))
    assert found["verdict"] == "stays_up"
    assert found["balanced"]
    assert found["error"]["mpjpe_cm"] < 12
    assert {each["body"] for each in found["floor"]} <= {"left_foot", "right_foot"}
    assert "balanced, without assist" in render(found, "walk")


def test_torques_keep_to_the_motors_limits(walk: RobotMotion) -> None:
    tracked = follow(walk, balance=True, frames=20)
    model = tracked.model
    limits = dict.fromkeys(range(model.njnt), np.inf)
    for a in range(model.nu):
        limits[int(model.actuator_trnid[a, 0])] = float(model.actuator_forcerange[a, 1])
    for joint, peak in enumerate(tracked.rollout.peak.max(axis=0)):
        assert peak <= limits[joint] * (1 + 1e-9)


def test_servos_give_beforehand_what_the_motion_needs(walk: RobotMotion) -> None:
    """Where nothing is off, each motor gives its torque, as far as it can; MuJoCo says so."""
    height = walk.robot.rig.standing_height
    model = servo_model(servo_spec(walk.body, height=height, floor_z=0.0, own=True)[0])
    names = [model.joint(int(model.actuator_trnid[a, 0])).name for a in range(model.nu)]
    wanted = {name: np.full(len(walk), 3.0 + k) for k, name in enumerate(names[:-1])}
    shifts = beforehand(model, wanted, len(walk), walk.frame_time)
    data = mujoco.MjData(model)
    data.qpos[:] = walk.body.qpos[10]
    mujoco.mj_forward(model, data)
    data.ctrl[:] = data.actuator_length + shifts[10]
    mujoco.mj_forward(model, data)
    given = [*np.minimum(3.0 + np.arange(model.nu - 1), model.actuator_forcerange[:-1, 1]), 0.0]
    np.testing.assert_allclose(data.actuator_force, given, atol=1e-9)


def test_the_same_motion_is_held_the_same_way(walk: RobotMotion) -> None:
    first, second = (follow(walk, balance=True, frames=12).rollout.qpos for _ in range(2))
    assert np.array_equal(first, second)
