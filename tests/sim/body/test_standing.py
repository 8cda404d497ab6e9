"""Bodies in simulation: they stand, hold their pose as they fall, and survive any control."""

from copy import copy
from dataclasses import replace
from pathlib import Path

import mjcf_doctor
import mujoco
import numpy as np
import pytest

from sim.body.actuators import ctrl_of_qpos
from sim.body.inertia import inertias
from sim.body.keyframes import balancing_lean
from sim.body.qpos import qpos_of_pose
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_about, quat_angle, quat_mul
from tests.helpers.bodies import STANDING, at_key, joint_errors_deg, rig_of, run, scene_of
from tests.helpers.recordings import recordings
from tests.helpers.stick import joint, stick_rig

JOINT_TYPES = ("ball", "hinge")


def feet_of(model: mujoco.MjModel) -> set[int]:
    """The bodies with a sole."""
    return {int(b) for b in model.geom_bodyid[model.geom_type == int(mujoco.mjtGeom.mjGEOM_BOX)]}


def on_floor(model: mujoco.MjModel, data: mujoco.MjData) -> set[int]:
    """The bodies that touch the floor."""
    bodies = model.geom_bodyid[data.contact.geom]
    return set(bodies.max(axis=1)[bodies.min(axis=1) == 0].tolist())


@pytest.mark.parametrize("joints", JOINT_TYPES)
@pytest.mark.parametrize("path", recordings(*STANDING))
def test_the_tpose_stands(path: Path, joints: str) -> None:
    model = scene_of(rig_of(path), joints)
    data = at_key(model, "tpose")
    start = data.qpos.copy()
    for k, _ in enumerate(run(model, data, 1.0)):
        if k % 20 == 0:
            assert on_floor(model, data) <= feet_of(model)
    assert len(on_floor(model, data)) >= 2
    assert np.linalg.norm(data.qpos[:3] - start[:3]) < 0.03
    assert np.degrees(quat_angle(data.qpos[3:7], start[3:7])) < 3
    assert max(joint_errors_deg(model, data.qpos, start).values()) < 3


def one_leg_lifted(rig: Rig) -> np.ndarray:
    """The T-pose, left thigh raised by 60 degrees, leaning off the right foot."""
    world = rig.tpose.copy()
    leg = list(rig.skeleton.subtree(rig.roles.require(Role.LEFT_UPPER_LEG)))
    world[leg] = quat_mul(quat_about("y", np.radians(-60.0)), world[leg])
    foot = list(rig.skeleton.subtree(rig.roles.require(Role.RIGHT_FOOT)))
    flat = world[foot]
    world = quat_mul(
        quat_mul(quat_about("y", np.radians(8.0)), quat_about("x", np.radians(5.0))), world
    )
    world[foot] = flat
    return world


@pytest.mark.parametrize("joints", JOINT_TYPES)
@pytest.mark.parametrize("path", recordings(*STANDING))
def test_an_unbalanced_pose_is_held_as_it_tips(path: Path, joints: str) -> None:
    rig = rig_of(path)
    model = scene_of(rig, joints)
    target = qpos_of_pose(model, rig, one_leg_lifted(rig))
    data = mujoco.MjData(model)
    data.qpos[:], data.ctrl[:] = target, ctrl_of_qpos(model, target)
    foot = {
        model.body(rig.skeleton.names[j]).id
        for j in rig.skeleton.subtree(rig.roles.require(Role.RIGHT_FOOT))
    }
    for k, _ in enumerate(run(model, data, 3.0)):
        if not on_floor(model, data) <= foot:  # it has fallen, or caught itself
            break
        if k % 5 == 0:
            assert max(joint_errors_deg(model, data.qpos, target).values()) < 3
    assert data.time < 3.0, "it did not fall: the pose is not unbalanced"
    assert data.time > 0.3


@pytest.mark.parametrize("joints", JOINT_TYPES)
@pytest.mark.parametrize("path", recordings(*STANDING))
def test_random_control_breaks_nothing(path: Path, joints: str) -> None:
    model = scene_of(rig_of(path), joints)
    data = at_key(model, "home")
    rng = np.random.default_rng(0)
    low, high = model.actuator_ctrlrange.T
    for k, _ in enumerate(run(model, data, 1.0)):
        if k % 25 == 0:
            data.ctrl[:] = rng.uniform(low, high)
    assert np.abs(data.qvel).max() < 200


@pytest.mark.parametrize("joints", JOINT_TYPES)
@pytest.mark.parametrize("path", recordings(*STANDING))
def test_the_doctor_finds_nothing(path: Path, joints: str) -> None:
    model = scene_of(rig_of(path), joints)
    found = mjcf_doctor.diagnose(model, duration=0.2).findings
    stock = "contact_default_soft"  # MuJoCo's own contact softness, which is meant for feet
    assert [f"{x.code} {x.subject}: {x.detail}" for x in found if x.code != stock] == []


def test_the_doctor_would_find_an_overlap() -> None:
    model = copy(scene_of(stick_rig()))
    model.geom_pos[model.geom_bodyid == model.body("left_lower_leg").id] += [0.0, 0.5, 1.0]
    codes = {finding.code for finding in mjcf_doctor.diagnose(model, duration=0.1).findings}
    assert "initial_penetration" in codes


def test_sensors_of_a_body_that_stands() -> None:
    model = scene_of(stick_rig())
    data = at_key(model, "tpose")
    for _ in run(model, data, 1.0):
        pass
    read = {
        model.sensor(i).name: data.sensor(model.sensor(i).name).data for i in range(model.nsensor)
    }
    weight = 9.81 * model.body_mass.sum()
    pressed = sum(float(value[0]) for name, value in read.items() if name.endswith("_touch"))
    assert pressed == pytest.approx(weight, rel=0.02)
    assert read["left_foot_touch"][0] == pytest.approx(read["right_foot_touch"][0], rel=0.1)
    np.testing.assert_allclose(read["imu_accelerometer"], [0, 0, 9.81], atol=0.5)
    np.testing.assert_allclose(read["imu_gyro"], 0, atol=0.05)
    assert np.degrees(quat_angle(read["imu_orientation"], np.array([1.0, 0, 0, 0]))) < 2
    assert np.degrees(quat_angle(read["left_upper_arm_pos"], data.joint("left_upper_arm").qpos)) < 1


def test_sites_are_where_they_are_named() -> None:
    model = scene_of(stick_rig())
    data = at_key(model, "tpose")
    at = {model.site(i).name: data.site_xpos[i] for i in range(model.nsite)}
    np.testing.assert_allclose(at["imu"], [0, 0, 0.9], atol=1e-9)
    assert at["left_hand"][1] == pytest.approx(-at["right_hand"][1])
    assert 0.75 < at["left_hand"][1] < 0.9
    assert at["head"][2] > 1.5
    assert at["left_foot"][2] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("joints", JOINT_TYPES)
def test_a_control_moves_both_sides_alike(joints: str) -> None:
    """Controls of right limbs are mirrored: the same on both sides leaves the body symmetric."""
    model = copy(scene_of(stick_rig(), joints))
    model.opt.gravity[:] = 0
    data = at_key(model, "tpose")
    data.qpos[2] += 1.0
    for i in range(model.nu):
        name = model.actuator(i).name
        if name.startswith("left"):
            low, high = model.actuator_ctrlrange[i]
            other = model.actuator("right" + name.removeprefix("left")).id
            data.ctrl[i] = data.ctrl[other] = 0.2 * high + 0.05 * low
    for _ in run(model, data, 0.5):
        pass
    for b in range(model.nbody):
        name = model.body(b).name
        if name.startswith("left"):
            left, right = data.xpos[b], data.body("right" + name.removeprefix("left")).xpos
            np.testing.assert_allclose(left * [1, -1, 1], right, atol=1e-3)
            assert "upper" in name or np.linalg.norm(left - model.body_pos[b]) > 0.01


def test_weight_behind_the_heels_is_leant_above_the_feet() -> None:
    """A body on short feet set forward, worked by hand: the angle brings the weight over them."""
    rig = stick_rig()
    masses = inertias(rig, 70.0)
    assert balancing_lean(rig, rig.tpose, masses) == 0.0
    offsets = rig.skeleton.offsets.copy()
    for knee in (joint(Role.LEFT_LOWER_LEG), joint(Role.RIGHT_LOWER_LEG)):
        offsets[knee, 0] += 0.1
    forward = replace(rig, skeleton=replace(rig.skeleton, offsets=offsets))
    angle = balancing_lean(forward, forward.tpose, inertias(forward, 70.0))
    # The weight, 0.9 m above ankles 0.1 m too far ahead, moves to 40 % of a foot 0.26 m long.
    assert np.degrees(angle) == pytest.approx(np.degrees(0.13 / 0.9), abs=3)
