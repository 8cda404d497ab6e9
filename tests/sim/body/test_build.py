"""MuJoCo bodies: they are the rig, on any axes, with a human's mass, and their files are read."""

from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest

from sim.body.build import build_body
from sim.body.mjcf import notes_of, to_xml, write_mjcf
from sim.body.qpos import qpos_from_motion
from spark.demo.sample import BUILDS, sample_motion, sample_rig
from spark.errors import OutputError, SkeletonError
from spark.io.reading import read_motion
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import Rig, understand
from spark.rotation import quat_angle, quat_conj, quat_mul
from spark.transfer.canonical import from_canonical, to_canonical
from tests.helpers.bodies import at_key, rig_of, scene_of
from tests.helpers.humanoids import ONE_A_RIG
from tests.helpers.recordings import recording, recordings
from tests.helpers.stick import stick_rig

JOINT_TYPES = ("ball", "hinge")


def rigid(path: Path) -> tuple[Motion, Rig]:
    """A recording without what its file stretches."""
    motion = read_motion(path).motion
    rig = understand(motion)
    return from_canonical(to_canonical(motion, rig)), rig


def worst_error(model: mujoco.MjModel, motion: Motion, rig: Rig) -> float:
    """The largest distance [m] between MuJoCo's bodies and our joints over the whole clip."""
    data = mujoco.MjData(model)
    joints = list(rig.skeleton.subtree(rig.root_joint))
    bodies = [model.body(rig.skeleton.names[j]).id for j in joints]
    positions, _ = forward(motion)
    worst = 0.0
    for qpos, expected in zip(qpos_from_motion(model, motion, rig), positions, strict=True):
        data.qpos[:] = qpos
        mujoco.mj_kinematics(model, data)
        worst = max(worst, float(np.abs(data.xpos[bodies] - expected[joints]).max()))
    return worst


@pytest.mark.parametrize("path", recordings(*ONE_A_RIG))
def test_mujoco_agrees_with_our_kinematics(path: Path, tmp_path: Path) -> None:
    motion, rig = rigid(path)
    written, _ = write_mjcf(build_body(rig), tmp_path / "body.xml")
    model = mujoco.MjModel.from_xml_path(str(written))
    assert worst_error(model, motion, rig) < 1e-6


def test_the_comparison_sees_a_wrong_bone() -> None:
    rig = sample_rig("walker")
    motion = sample_motion("walk", rig, 10.0)
    spec = build_body(rig)
    knee = spec.body(rig.skeleton.names[3])
    knee.pos[2] += 1e-4
    assert worst_error(spec.compile(), motion, rig) > 5e-5


@pytest.mark.parametrize("path", recordings("zoo/ad_rokoko_mixamo.bvh", "zoo/m2m_human.bvh"))
def test_coordinates_are_rotations_since_the_tpose(path: Path) -> None:
    """Whatever the axes of the file's joints: zero is the T-pose, a body's `xquat` is G."""
    motion, rig = rigid(path)
    model = build_body(rig).compile()
    assert np.all(model.body_quat == [1, 0, 0, 0])
    at_zero = at_key(model, "tpose").qpos
    np.testing.assert_allclose(at_zero[3:], np.tile([1, 0, 0, 0], (model.nq - 3) // 4), atol=1e-12)
    data = mujoco.MjData(model)
    data.qpos[:] = qpos_from_motion(model, motion, rig)[0]
    mujoco.mj_kinematics(model, data)
    since_tpose = quat_mul(forward(motion)[1][0], quat_conj(rig.tpose))
    for j in rig.skeleton.subtree(rig.root_joint):
        xquat = data.xquat[model.body(rig.skeleton.names[j]).id]
        assert quat_angle(xquat, since_tpose[j]) < 1e-7


@pytest.mark.parametrize("build", BUILDS)
def test_mass(build: str) -> None:
    rig = sample_rig(build)
    given = build_body(rig, mass=50.0).compile()
    assert given.body_mass.sum() == pytest.approx(50.0, rel=1e-3)
    free = build_body(rig).compile()
    assert free.body_mass.sum() == pytest.approx(22 * BUILDS[build].height ** 2, rel=0.1)
    with pytest.raises(SkeletonError, match="mass is -1"):
        build_body(rig, mass=-1.0)


def bones_of(model: mujoco.MjModel, body: str) -> list[float]:
    """How thick a body's capsules are [m]."""
    geoms = np.flatnonzero(model.geom_bodyid == model.body(body).id)
    round_ones = geoms[model.geom_type[geoms] == mujoco.mjtGeom.mjGEOM_CAPSULE]
    return list(model.geom_size[round_ones, 0])


def test_a_link_is_as_thick_as_what_hangs_on_it() -> None:
    model = scene_of(rig_of(recording("zoo/cmu_cgspeed_31j.bvh")))
    [hip], [thigh] = bones_of(model, "LHipJoint"), bones_of(model, "LeftUpLeg")
    assert 0.9 * thigh < hip < thigh


def test_a_chest_that_carries_arms_has_shoulders_beside_its_neck() -> None:
    model = scene_of(rig_of(recording("deepmimic/deepmimic_walk.bvh")))
    data = at_key(model, "tpose")
    trunk, *shoulders = sorted(bones_of(model, "chest"), reverse=True)
    assert len(shoulders) == 2
    assert max(shoulders) < 0.6 * trunk
    for geom in np.flatnonzero(model.geom_bodyid == model.body("chest").id):
        if model.geom_size[geom, 0] < trunk:
            upright = abs(data.geom_xmat[geom].reshape(3, 3)[2, 2])
            assert upright < 0.3, "they cross the chest, and don't climb from its joint"


def test_a_static_root_is_no_body() -> None:
    model = build_body(rig_of(recording("zoo/m2m_human.bvh"))).compile()
    names = {model.body(b).name for b in range(model.nbody)}
    assert "root" not in names
    assert "DEF-hips" in names


@pytest.mark.parametrize("joints", JOINT_TYPES)
def test_keyframes_are_within_ranges_and_held_by_their_controls(joints: str) -> None:
    model = scene_of(sample_rig("walker"), joints)
    low, high = model.actuator_ctrlrange.T
    for key in ("tpose", "home"):
        data = at_key(model, key)
        np.testing.assert_allclose(data.actuator_length, data.ctrl, atol=1e-9)
        np.testing.assert_allclose(data.actuator_force, 0.0, atol=1e-6)
        assert np.all((low <= data.ctrl) & (data.ctrl <= high))
        assert data.nefc == 0 or not np.any(
            data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_LIMIT_JOINT)
        )
    arms = [model.body(f"mixamorig:{side}Hand").id for side in ("Left", "Right")]
    down, out = (at_key(model, key).xpos[arms] for key in ("home", "tpose"))
    assert np.all(down[:, 2] < out[:, 2] - 0.3)


@pytest.mark.parametrize("joints", JOINT_TYPES)
def test_everything_that_can_be_named_has_a_name_and_every_joint_a_servo(joints: str) -> None:
    model = scene_of(sample_rig("walker"), joints)
    named = [
        (model.nbody, model.body),
        (model.njnt, model.joint),
        (model.nu, model.actuator),
        (model.nsensor, model.sensor),
        (model.nsite, model.site),
        (model.nkey, model.key),
        (model.nmat, model.material),
    ]
    for count, of in named:
        names = [of(i).name for i in range(count)]
        assert all(names)
        assert len(set(names)) == count
    driven = {int(j) for j in model.actuator_trnid[:, 0]}
    assert driven == set(range(1, model.njnt))
    assert np.all(model.actuator_ctrllimited)
    assert np.all(model.actuator_forcelimited)


@pytest.mark.parametrize("path", recordings(*ONE_A_RIG))
def test_masses_and_inertias_are_those_of_bodies(path: Path) -> None:
    model = build_body(rig_of(path)).compile()
    assert np.all(model.body_mass[1:] > 0)
    moments = np.sort(model.body_inertia[1:], axis=1)
    assert np.all(moments[:, 0] > 0)
    assert np.all(moments[:, 2] <= moments[:, :2].sum(1) + 1e-9)


@pytest.mark.parametrize("joints", JOINT_TYPES)
def test_the_file_is_written_to_be_read(joints: str) -> None:
    """What joints and servos are like is said once, in their class."""
    root = ElementTree.fromstring(to_xml(build_body(stick_rig(), joints=joints)))
    classes = {default.get("class") for default in root.find("default").iter("default")}
    assert {"body", "visual", "collision", "foot", "hip", "knee", "shoulder"} <= classes
    world = root.find("worldbody")
    actuators = root.find("actuator")
    assert world is not None
    assert actuators is not None
    assert {e.get("class") for e in (*world.iter("joint"), *actuators)} <= classes
    for joint in world.iter("joint"):
        assert set(joint.keys()) <= {"name", "class", "axis"}
    for servo in actuators:
        assert servo.tag == "position"
        assert set(servo.keys()) <= {"name", "class", "joint", "jointinparent", "gear"}
    for geom in world.iter("geom"):
        assert not {"rgba", "group", "contype", "friction", "mass"} & set(geom.keys())
    numbers = [
        word
        for element in root.iter()
        for value in element.attrib.values()
        for word in value.split()
        if word[-1].isdigit() and word[0] in "-0123456789"
    ]
    assert len(numbers) > 500
    assert max(map(len, numbers)) <= len("-0.123456789e-05")


def test_a_body_that_can_not_be_written_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="can't be written"):
        write_mjcf(build_body(stick_rig()), tmp_path / "missing" / "b.xml")


def test_notes_are_the_comment_of_the_file() -> None:
    rig = rig_of(recording("mesh2motion/kaiju_Idle.bvh"))
    spec = build_body(rig, joints="hinge")
    assert notes_of(spec)[0].startswith("the body's weight")
    assert all(note in to_xml(spec) for note in notes_of(spec))
    assert notes_of(build_body(stick_rig())) == ()
