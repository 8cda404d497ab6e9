"""A motion onto a robot, from file to file: within limits, feet on the floor, in MuJoCo's words."""

import json
import random
import re
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from tempfile import TemporaryFile

import mujoco
import numpy as np
import pytest

import spark_sim
from spark.errors import ConventionError, SparkSimError
from spark.kinematics import forward
from spark.rig.roles import Role
from spark.transfer.canonical import to_canonical
from spark_sim.cli import run
from spark_sim.clips import RobotClip
from spark_sim.retargeting import COPIED

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
def walk(walk_path: Path) -> spark_sim.Clip:
    clip = spark_sim.load(walk_path)
    assert isinstance(clip, spark_sim.Clip)
    return clip


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


def on_command_line(*args: object) -> tuple[int, list[str], list[str]]:
    """Exit code, and the lines of stdout and stderr, of one command."""
    with TemporaryFile("w+") as out, TemporaryFile("w+") as err:
        with redirect_stdout(out), redirect_stderr(err):
            code = run([str(arg) for arg in args])
        out.seek(0)
        err.seek(0)
        return code, out.read().splitlines(), err.read().splitlines()


CHAIN = "".join(
    f'<body name="link{k}" pos="0 0 .1"><joint axis="0 1 0"/><geom size=".05"/>' for k in range(8)
)
SNAKE = (
    '<mujoco><worldbody><body name="base"><freejoint/><geom size=".1"/>'
    f"{CHAIN}{'</body>' * 8}</body></worldbody></mujoco>"
)
BODY = ROBOT[ROBOT.index("<body") : ROBOT.rindex("</body>") + len("</body>")]
BAD = {
    "no XML": ("not xml", "is no XML"),
    "empty": ("", "is no XML"),
    "cut off": (ROBOT[:900], "is no XML"),
    "a web page": ("<html><body>404</body></html>", "MuJoCo can't read it"),
    "does not compile": (ROBOT.replace('"0.7"', '"x"').replace("capsule", "bag"), "MuJoCo can't"),
    "includes itself": ('<mujoco><include file="bad.xml"/></mujoco>', "includes 'bad.xml' again"),
    "no robot": ("<mujoco><worldbody/></mujoco>", "the model has no joints; expected a humanoid"),
    "no legs": (SNAKE, "not a humanoid"),
    "two robots": (
        ROBOT.replace(BODY, BODY + BODY.replace('name="', 'name="twin_')),
        "holds several robots; expected one: keep one of them in the file (bodies 'pelvis', "
        "'twin_pelvis')",
    ),
    "no T-pose": (
        ROBOT.replace('range="-2.2 1.6"', 'range="1.2 1.6"'),
        "the joint limits forbid a T-pose (legs down, arms out)",
    ),
    "no number": (
        ROBOT.replace('pos="0 0 0.7"', 'pos="0 0 nan"'),
        "body 'pelvis': pos='0 0 nan' is no number",
    ),
    "no number beside": (
        ROBOT.replace('name="waist_yaw" axis', 'name="waist_yaw" damping="nan" axis'),
        "joint 'waist_yaw': damping='nan' is no number",
    ),
    "too far": (ROBOT.replace('pos="0 0 0.7"', 'pos="0 0 1e30"'), "body 'pelvis': its place is"),
    "no end": (
        ROBOT.replace('name="waist_yaw" axis="0 0 1"', 'name="waist_yaw" axis="0 0 inf"'),
        "joint 'waist_yaw': has numbers that are not finite (axis)",
    ),
}


@pytest.mark.parametrize("what", BAD)
def test_what_is_no_robot_is_refused(what: str, walk_path: Path, tmp_path: Path) -> None:
    text, says = BAD[what]
    bad = tmp_path / "bad.xml"
    bad.write_text(text)
    out = tmp_path / "out.npz"
    code, stdout, stderr = on_command_line("retarget", walk_path, "--to", bad, "-o", out)
    assert (code, stdout) == (2, [])
    assert re.match(rf"spark-sim: error: {re.escape(str(bad))}:(\d+:)? ", stderr[-1])
    assert says in stderr[-1]
    assert [path.name for path in tmp_path.iterdir()] == ["bad.xml"]


VALUES = ("0", "nan", "inf", "1e308", "-1", "", "x", "1 2", "1e-300", "pelvis", "left_knee")


@pytest.mark.parametrize("seed", range(25))
def test_a_model_changed_at_random_is_understood_or_refused(seed: int, tmp_path: Path) -> None:
    draw, text = random.Random(seed), ROBOT
    for _ in range(draw.choice([1, 1, 2, 4])):
        value = draw.choice([*re.finditer(r'="([^"]*)"', text)])
        tag = draw.choice([*re.finditer("<[^>]*>", text)])
        start, stop, new = draw.choice(
            [
                (value.start(1), value.end(1), draw.choice(VALUES)),
                (tag.start(), tag.end(), ""),
                (tag.start(), tag.end(), 2 * tag.group()),
            ]
        )
        text = text[:start] + new + text[stop:]
    path = tmp_path / "changed.xml"
    path.write_text(text)
    found: object
    try:
        found = spark_sim.load(path)
    except SparkSimError as error:
        found = str(error)
    if isinstance(found, str):
        assert re.match(rf"{re.escape(str(path))}:(\d+:)? ", found)
    else:
        assert isinstance(found, RobotClip)
        assert np.isfinite(found.on_robot.qpos).all()


def test_a_folder_is_no_robot(walk_path: Path, tmp_path: Path) -> None:
    (tmp_path / "g1.xml").mkdir()
    code, _, stderr = on_command_line("retarget", walk_path, "--to", tmp_path / "g1.xml")
    assert code == 2
    assert "g1.xml: is a folder; expected an MJCF (.xml)" in stderr[-1]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda text: re.sub(' range="[^"]*"', "", text), "22 hinges have no limits: taken as 180"),
        (lambda text: text.replace("<freejoint/>", ""), "no free joint: one was given to 'pelvis'"),
    ],
)
def test_what_is_assumed_of_a_robot_is_said(
    change: Callable[[str], str],
    says: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("odd.xml").write_text(change(ROBOT))
    code, stdout, stderr = on_command_line("inspect", "odd.xml")
    assert code == 0
    assert stdout[0] == "odd"
    assert any(line.startswith("spark-sim: note: odd.xml: ") and says in line for line in stderr)
    assert [path.name for path in tmp_path.iterdir()] == ["odd.xml"]


def test_a_map_corrects_a_robot(model: Path, walk_path: Path, tmp_path: Path) -> None:
    toml = tmp_path / "map.toml"
    assert on_command_line("inspect", model, "--save-map", toml)[0] == 0
    text = toml.read_text()
    assert 'left_forearm = "left_elbow"' in text
    unchanged = spark_sim.load(model, roles=toml).rig.roles.roles
    assert unchanged == spark_sim.load(model).rig.roles.roles
    toml.write_text(text.replace('head = "head"', "head = []"))
    roles = spark_sim.load(model, roles=toml).rig.roles
    assert roles.joint(Role.HEAD) is None
    assert roles.joint(Role.LEFT_FOREARM) is not None


def test_a_robot_s_motion_goes_on_to_other_bodies(
    moved: RobotClip, walk: spark_sim.Clip, tmp_path: Path
) -> None:
    """Through a file, to another robot and back to a character, legs as they were."""
    written = moved.save(tmp_path / "takes" / "walk.csv")
    told = ("--robot", moved.on_robot.robot.mjcf.path, "--quat", "xyzw", "--fps", walk.motion.fps)
    command = ("retarget", tmp_path / "takes", *told, "-o", tmp_path / "out")
    assert on_command_line(*command, "--to", "robot")[0] == 0
    on_ember = spark_sim.load(tmp_path / "out" / "walk_on_robot.npz")
    assert isinstance(on_ember, RobotClip)
    assert on_ember.motion.frame_time == pytest.approx(walk.motion.frame_time, rel=1e-6)
    back = spark_sim.retarget(on_ember, walk)
    knee = back.rig.roles.require(Role.LEFT_LOWER_LEG)
    path, original = (
        forward(c.motion)[0][:, knee] - forward(c.motion)[0][:, c.rig.pelvis] for c in (back, walk)
    )
    assert np.linalg.norm(path - original, axis=1).mean() < 0.1
    assert written.exists()


def test_a_robot_without_arms_moves_its_legs_and_says_so(
    moved: RobotClip, walk_path: Path, tmp_path: Path
) -> None:
    start = ROBOT.index('<body name="torso"')
    legs = tmp_path / "legs.xml"
    legs.write_text(ROBOT[:start] + ROBOT[ROBOT.rindex("</body></worldbody>") :])
    out = tmp_path / "out.npz"
    code, _, stderr = on_command_line("retarget", walk_path, "--to", legs, "-o", out)
    assert code == 0
    assert any("out.npz: the target has no arms: what the source's do" in line for line in stderr)
    result = spark_sim.load(out)
    assert isinstance(result, RobotClip)
    assert len(result.on_robot.robot.joint_names) == 12
    back = spark_sim.retarget(result, moved)
    assert any("the source has no arms" in note for note in back.notes)


def test_onto_itself_a_robot_moves_as_it_does(moved: RobotClip) -> None:
    """Projection alone gives every hinge back; the solver stays near it."""
    own = moved.on_robot.qpos
    same = spark_sim.retarget(moved, moved, refine=False)
    assert isinstance(same, RobotClip)
    np.testing.assert_allclose(same.on_robot.qpos[:, 7:], own[:, 7:], atol=1e-6)
    np.testing.assert_allclose(same.on_robot.qpos[:, :2], own[:, :2], atol=1e-6)
    solved = spark_sim.retarget(moved, moved)
    assert isinstance(solved, RobotClip)
    assert np.degrees(np.abs(solved.on_robot.qpos[:, 7:] - own[:, 7:])).mean() < 6


def test_options_that_a_file_does_not_have_are_refused(walk_path: Path) -> None:
    with pytest.raises(ConventionError, match="quat does not go with"):
        spark_sim.load(walk_path, quat="xyzw")


def test_formats_are_for_robots(walk_path: Path, tmp_path: Path) -> None:
    command = ("retarget", walk_path, "--to", walk_path, "--format", "gmr")
    code, _, stderr = on_command_line(*command)
    assert code == 2
    assert "--format is for robots" in stderr[-1]
    out = tmp_path / "out.npz"
    to_robot = ("retarget", walk_path, "--to", "robot", "--format", "gmr", "-o", out)
    code, _, stderr = on_command_line(*to_robot)
    assert code == 2
    assert "the format 'gmr' is written as .pkl" in stderr[-1]


def test_a_copy_is_each_pose_on_the_hinges_and_says_so(walk: spark_sim.Clip, model: Path) -> None:
    plain = spark_sim.retarget(walk, model, refine=False)
    copied = spark_sim.retarget(walk, model, method="copy")
    assert isinstance(plain, RobotClip)
    assert isinstance(copied, RobotClip)
    np.testing.assert_array_equal(copied.on_robot.qpos, plain.on_robot.qpos)
    assert COPIED in plain.notes
    assert COPIED in copied.notes
    solved = spark_sim.retarget(walk, model)
    assert COPIED not in solved.notes
    assert np.abs(plain.motion.rotations - solved.motion.rotations).max() > 0.01
    with pytest.raises(ConventionError, match="robots are solved for"):
        spark_sim.retarget(walk, model, method="spark", checkpoint="none")
