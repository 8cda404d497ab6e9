"""A motion onto a robot, from file to file: within limits, feet on the floor, in MuJoCo's words."""

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest

import spark_sim
from spark.canonical import to_canonical
from spark.errors import SparkSimError
from spark_sim.robot import RobotClip

# A humanoid of hinges, 1.2 m high: hips and shoulders of three, knees, elbows and ankles.
LEG = """
<body name="{s}_hip" pos="0 {y} -0.05">
  <joint name="{s}_hip_pitch" axis="0 1 0" range="-2.2 1.6"/>
  <joint name="{s}_hip_roll" axis="1 0 0" range="-0.8 0.8"/>
  <joint name="{s}_hip_yaw" axis="0 0 1" range="-1.5 1.5"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.28" size="0.05"/>
  <body name="{s}_knee" pos="0 0 -0.3">
    <joint name="{s}_knee" axis="0 1 0" range="0 2.5"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.28" size="0.04"/>
    <body name="{s}_ankle" pos="0 0 -0.3">
      <joint name="{s}_ankle_pitch" axis="0 1 0" range="-1 0.8"/>
      <joint name="{s}_ankle_roll" axis="1 0 0" range="-0.4 0.4"/>
      <geom type="box" pos="0.04 0 -0.04" size="0.1 0.04 0.015"/>
    </body>
  </body>
</body>"""
ARM = """
<body name="{s}_shoulder" pos="0 {y} 0.25">
  <joint name="{s}_shoulder_pitch" axis="0 1 0" range="-3 3"/>
  <joint name="{s}_shoulder_roll" axis="1 0 0" range="-2.8 2.8"/>
  <joint name="{s}_shoulder_yaw" axis="0 0 1" range="-2.8 2.8"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.035"/>
  <body name="{s}_elbow" pos="0 0 -0.22">
    <joint name="{s}_elbow" axis="0 1 0" range="-2.4 0.1"/>
    <geom type="capsule" fromto="0 0 0 0 0 -0.2" size="0.03"/>
  </body>
</body>"""
SIDES = (("left", 0.08, 0.16), ("right", -0.08, -0.16))
ROBOT = (
    '<mujoco model="hinged"><compiler angle="radian"/><worldbody><body name="pelvis" pos="0 0 0.7">'
    '<freejoint/><geom type="capsule" fromto="0 -0.06 0 0 0.06 0" size="0.06"/>'
    + "".join(LEG.format(s=side, y=hip) for side, hip, _ in SIDES)
    + '<body name="torso" pos="0 0 0.08"><joint name="waist_yaw" axis="0 0 1" range="-2 2"/>'
    '<geom type="capsule" fromto="0 0 0.05 0 0 0.25" size="0.09"/>'
    + "".join(ARM.format(s=side, y=shoulder) for side, _, shoulder in SIDES)
    + '<body name="head" pos="0 0 0.35"><joint name="neck_yaw" axis="0 0 1" range="-1 1"/>'
    '<geom type="sphere" pos="0 0 0.08" size="0.08"/></body>'
    "</body></body></worldbody></mujoco>"
)


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("robot") / "hinged.xml"
    path.write_text(ROBOT)
    return path


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> spark_sim.Clip:
    folder = tmp_path_factory.mktemp("samples")
    spark_sim.sample(folder)
    return spark_sim.load(folder / "walker_walk.bvh")


@pytest.fixture(scope="module")
def moved(walk: spark_sim.Clip, model: Path) -> RobotClip:
    result = spark_sim.retarget(walk, model)
    assert isinstance(result, RobotClip)
    return result


def test_a_walk_onto_hinges(
    walk: spark_sim.Clip, moved: RobotClip, model: Path, tmp_path: Path
) -> None:
    written = moved.save(tmp_path / "walk.npz")
    with np.load(written, allow_pickle=False) as stored:
        qpos = stored["qpos"]
        about = json.loads(str(stored["about"]))
        names = stored["joint_names"].tolist()
    assert about["quaternion"] == "wxyz"
    assert qpos.shape == (len(walk.motion), 7 + len(names))
    mj = mujoco.MjModel.from_xml_path(str(model))
    data = mujoco.MjData(mj)
    for name, column in zip(names, qpos[:, 7:].T, strict=True):
        low, high = mj.joint(name).range
        assert low - 1e-6 <= column.min(), name
        assert column.max() <= high + 1e-6, name
    assert np.allclose(np.linalg.norm(qpos[:, 3:7], axis=1), 1)

    # MuJoCo's own kinematics: thighs and shanks point where the walker's do, soles on the floor.
    rig, names_of = walk.rig, walk.motion.skeleton.names
    canonical = to_canonical(walk.motion, rig)
    down = np.array([0.0, 0, -1])
    errors, lowest = [], []
    for t in range(len(qpos)):
        data.qpos[:] = qpos[t]
        mujoco.mj_kinematics(mj, data)
        for side in ("left", "right"):
            for part, joint in (("hip", "UpLeg"), ("knee", "Leg")):
                below = {"hip": "knee", "knee": "ankle"}[part]
                bone = data.body(f"{side}_{below}").xpos - data.body(f"{side}_{part}").xpos
                j = names_of.index(f"mixamorig:{side.capitalize()}{joint}")
                w, *v = canonical.rotations[t, j]
                expected = down + 2 * np.cross(v, np.cross(v, down) + w * down)
                errors.append(np.arccos(np.clip(bone @ expected / np.linalg.norm(bone), -1, 1)))
        soles = [g for g in range(mj.ngeom) if mj.geom_type[g] == 6]
        lowest.append(
            min(
                data.geom_xpos[g][2] - np.abs(data.geom_xmat[g].reshape(3, 3)[2]) @ mj.geom_size[g]
                for g in soles
            )
        )
    assert np.degrees(np.mean(errors)) < 8
    assert np.percentile(lowest, 5) > -0.015
    assert np.median(lowest) < 0.02


def test_what_is_no_robot_is_refused(tmp_path: Path) -> None:
    for text in ("<mujoco><worldbody/></mujoco>", "<mujoco>", "not xml", ""):
        path = tmp_path / "bad.xml"
        path.write_text(text)
        with pytest.raises(SparkSimError, match=r"bad\.xml"):
            spark_sim.load(path)
