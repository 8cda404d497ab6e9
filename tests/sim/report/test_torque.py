"""Joint torques against answers worked out by hand and MuJoCo's own inverse dynamics."""

import mujoco
import numpy as np
import pytest
from jaxtyping import Float

from robots import registry
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.model.understand import understand_robot
from sim.interpolate import velocities as central
from sim.physics.servos import torque_limit
from sim.report import Subject, assess
from sim.report.model_joints import model_joint_rates
from sim.report.torque import JointTorque, joint_torques, rates
from sim.trajectory import ModelTrajectory
from spark.rig.feet import sole_positions

G, FRAMES, FRAME_TIME = 9.81, 30, 1 / 60

# A torso of 10 kg that leans 10 cm ahead of its ankle, on a foot of 1 kg and 30 cm; an arm of 2 kg
# whose middle is 25 cm from the shoulder.
LEANING = """
<mujoco>
  <worldbody>
    <body name="torso" pos="0 0 0.5">
      <freejoint/>
      <geom type="sphere" size="0.05" mass="10" pos="0.1 0 0"/>
      <body name="arm" pos="0 0 0.3">
        <joint name="shoulder" axis="0 1 0" actuatorfrcrange="-4 4"/>
        <geom type="sphere" size="0.05" mass="2" pos="0.25 0 0"/>
      </body>
      <body name="foot" pos="0 0 -0.5">
        <joint name="ankle" axis="0 1 0" actuatorfrcrange="-30 30"/>
        <geom type="box" size="0.15 0.05 0.01" mass="1" pos="0.05 0 0.01"/>
      </body>
    </body>
  </worldbody>
</mujoco>
"""
CORNERS = np.array([[x, y, 0.0] for x in (-0.1, 0.2) for y in (-0.05, 0.05)])


def leaning(acceleration: float = 0.0, mjcf: str = LEANING) -> tuple[JointTorque, ...]:
    """Of the model above, its foot flat; all of it is accelerated upwards [m/s²] with the floor."""
    spec = mujoco.MjSpec.from_string(mjcf)
    model = spec.compile()
    qpos = np.tile(mujoco.MjData(model).qpos, (FRAMES, 1))
    rise = 0.5 * acceleration * (np.arange(FRAMES) * FRAME_TIME) ** 2
    qpos[:, 2] += rise
    points = np.tile(CORNERS, (FRAMES, 1, 1))
    points[..., 2] += rise[:, None]
    return joint_torques(
        ModelTrajectory(spec, model, int(model.body("torso").id), qpos),
        FRAME_TIME,
        0.05,
        points,
        np.full(4, int(model.body("foot").id)),
        np.ones((FRAMES, 4), dtype=bool),
        1.0,
        0.5,
    )


@pytest.mark.parametrize("acceleration", [0.0, 2.0])
def test_a_body_that_leans_on_its_ankle(acceleration: float) -> None:
    """10 kg at 10 cm and 2 kg at 25 cm ahead of the ankle turn it, whichever corner pushes."""
    shoulder, ankle = sorted(leaning(acceleration), key=lambda each: each.limit)
    pull = G + acceleration
    np.testing.assert_allclose(shoulder.torque, -2 * 0.25 * pull, rtol=1e-6)
    np.testing.assert_allclose(ankle.torque, (10 * 0.1 + 2 * 0.25) * pull, rtol=2e-3)
    assert (shoulder.limit, ankle.limit) == (4, 30)
    np.testing.assert_allclose(shoulder.load, 0.5 * pull / 4, rtol=1e-6)


def test_joints_without_a_name_have_one_name_in_all_measures() -> None:
    """The report's table finds a joint's torque by the name that its speed has."""
    nameless = LEANING.replace(' name="shoulder"', "")
    spec = mujoco.MjSpec.from_string(nameless)
    model = spec.compile()
    body = ModelTrajectory(spec, model, int(model.body("torso").id), np.zeros((3, model.nq)))
    rates = model_joint_rates(body, FRAME_TIME, 0.05)
    assert {each.joint for each in leaning(mjcf=nameless)} == set(rates.names)
    assert "joint 1 of arm" in rates.names


def test_without_the_floor_an_ankle_carries_its_foot_alone() -> None:
    """In the air, nothing but the foot's own weight is left: 1 kg, 5 cm ahead."""
    spec = mujoco.MjSpec.from_string(LEANING)
    model = spec.compile()
    torques = joint_torques(
        ModelTrajectory(
            spec, model, int(model.body("torso").id), np.tile(mujoco.MjData(model).qpos, (9, 1))
        ),
        FRAME_TIME,
        0.05,
        np.tile(CORNERS, (9, 1, 1)),
        np.full(4, int(model.body("foot").id)),
        np.zeros((9, 4), dtype=bool),
        1.0,
        0.5,
    )
    ankle = next(each for each in torques if each.joint == "ankle")
    np.testing.assert_allclose(ankle.torque, -0.05 * G, rtol=1e-6)


LIMITS = """
<mujoco>
  <worldbody>
    <body><freejoint/><geom size="0.1"/>
      <body name="a"><joint name="geared"/><geom size="0.1"/></body>
      <body name="b"><joint name="control"/><geom size="0.1"/></body>
      <body name="c"><joint name="servo"/><geom size="0.1"/></body>
      <body name="d"><joint name="both" actuatorfrcrange="-7 7"/><geom size="0.1"/></body>
      <body name="e"><joint name="free"/><geom size="0.1"/></body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="geared" gear="6" forcerange="-3 3"/>
    <motor joint="control" gear="50" ctrlrange="-1 1"/>
    <position joint="servo" kp="100" ctrlrange="-2 2" forcerange="-21 21"/>
    <motor joint="both" forcerange="-9 9"/>
    <motor joint="free"/>
  </actuator>
</mujoco>
"""


def test_the_limit_is_the_lowest_that_the_file_tells() -> None:
    model = mujoco.MjSpec.from_string(LIMITS).compile()
    found = {
        name: torque_limit(model, int(model.joint(name).id))
        for name in ("geared", "control", "servo", "both", "free")
    }
    assert found == {"geared": 18, "control": 50, "servo": 21, "both": 7, "free": None}


@pytest.fixture(scope="module")
def robot() -> Morphology:
    return understand_robot(registry.find("robot"))


def standing(robot: Morphology, frames: int = 60) -> Float[np.ndarray, "T nq"]:
    qpos = np.tile(robot.to_qpos(robot.tpose)[0], (frames, 1))
    soles = [sole_positions(s, robot.rig.tpose_positions, robot.rig.tpose) for s in robot.rig.soles]
    lowest = np.concatenate(soles)[:, 2].min()
    qpos[:, 2] += -lowest - robot.motion(robot.from_qpos(qpos[:1]), 1.0).root_pos[0, 2]
    return qpos


def test_arms_need_what_mujoco_says(robot: Morphology) -> None:
    """The floor doesn't reach them: a moving arm's torques are those of inverse dynamics alone."""
    model, qpos = robot.mjcf.model, standing(robot)
    joint = model.joint("left_elbow")
    times = np.arange(len(qpos)) * FRAME_TIME
    qpos[:, int(joint.qposadr[0])] = -0.8 + 0.3 * np.sin(6 * times)
    moved = RobotMotion(robot, robot.from_qpos(qpos), FRAME_TIME)
    report = assess(Subject(moved.motion, robot.rig, moved.body))
    found = next(each for each in report.clip.torques if each.joint == "left_elbow")
    data, dof = mujoco.MjData(model), int(joint.dofadr[0])
    for t in (20, 30, 45):
        data.qpos[:], data.qvel[:], data.qacc[:] = qpos[t], 0, 0
        data.qvel[dof] = 0.3 * 6 * np.cos(6 * times[t])
        data.qacc[dof] = -0.3 * 36 * np.sin(6 * times[t])
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        mujoco.mj_inverse(model, data)
        assert found.torque[t] == pytest.approx(data.qfrc_inverse[dof], abs=0.05)
    model.opt.disableflags = 0


def test_a_move_that_is_too_fast_for_a_motor_is_named(robot: Morphology) -> None:
    qpos = standing(robot, 120)
    still = RobotMotion(robot, robot.from_qpos(qpos), FRAME_TIME)
    calm = assess(Subject(still.motion, robot.rig, still.body))
    assert calm.clip.overload_share == 0
    assert not [finding for finding in calm.findings if finding.measure == "torque"]
    column = int(robot.mjcf.model.joint("left_shoulder_roll").qposadr[0])
    qpos[:, column] += 0.4 * np.sin(22 * np.arange(120) * FRAME_TIME)
    fast = RobotMotion(robot, robot.from_qpos(qpos), FRAME_TIME)
    report = assess(Subject(fast.motion, robot.rig, fast.body))
    over = [finding for finding in report.findings if finding.measure == "torque"]
    assert over
    assert {finding.where for finding in over} >= {"left_shoulder_roll"}
    assert "its motor gives" in over[0].sentence
    assert report.clip.overload_share == pytest.approx(report.json()["clip"]["over_torque_share"])
    assert "over torque" in report.text()


def test_velocities_and_accelerations_are_mujocos(robot: Morphology) -> None:
    """Of a slow turn and move, free joint and hinges alike."""
    qpos = standing(robot)
    times = np.arange(len(qpos)) * FRAME_TIME
    half = 0.5 * np.sin(times)
    qpos[:, 3:7] = np.stack([np.cos(half), 0 * half, np.sin(half) * 0.6, np.sin(half) * 0.8], 1)
    qpos[:, :3] += 0.2 * np.sin(times)[:, None]
    qpos[:, 7:] += 0.1 * np.sin(2 * times)[:, None]
    model = robot.mjcf.model
    ours = rates(model, qpos, FRAME_TIME, 1, 0.05)[5:-5]
    velocity = central(model, qpos, FRAME_TIME)
    np.testing.assert_allclose(ours, velocity[5:-5], atol=2e-3)
    turned = rates(model, qpos, FRAME_TIME, 2, 0.05)[5:-5]
    np.testing.assert_allclose(turned, np.gradient(velocity, FRAME_TIME, axis=0)[5:-5], atol=2e-2)
