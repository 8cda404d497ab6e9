"""Robots as URDF: the same as their twins in MJCF, whatever is wrong with meshes and inertias."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

import spark_sim
from robots import registry
from robots.model.known import known
from robots.model.mjcf import read_mjcf
from robots.model.understand import understand_robot
from robots.solver.solve import copy, retarget
from spark.errors import ConventionError, FileFormatError, SkeletonError
from spark.rig.roles import Role
from spark_sim.clips import Clip, RobotClip
from tests.helpers.urdf import twins


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("urdf")
    mjcf, urdf = twins(mujoco.MjSpec.from_file(str(registry.find("robot"))))
    (made / "twin.xml").write_text(mjcf)
    (made / "twin.urdf").write_text(urdf)
    spark_sim.sample(made)
    return made


@pytest.fixture(scope="module")
def walk(folder: Path) -> Clip:
    clip = spark_sim.load(folder / "walker_walk.bvh")
    assert isinstance(clip, Clip)
    return clip.part(0.0, 1.0)


def test_a_urdf_is_its_mjcf_twin(folder: Path, walk: Clip) -> None:
    first, second = known(folder / "twin.xml"), known(folder / "twin.urdf")
    assert first.joint_names == second.joint_names
    np.testing.assert_allclose(second.tree.axes, first.tree.axes, atol=1e-9)
    np.testing.assert_allclose(second.tpose.angles, first.tpose.angles, atol=1e-9)
    assert second.rig.hip_height == pytest.approx(first.rig.hip_height, abs=1e-9)
    for way in (copy, retarget):
        ours, theirs = (way(walk.canonical, robot).qpos for robot in (second, first))
        np.testing.assert_allclose(ours, theirs, atol=1e-6)


def test_a_urdf_stands_on_the_floor(folder: Path) -> None:
    model = read_mjcf(folder / "twin.urdf").model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    twin = mujoco.MjModel.from_xml_path(str(folder / "twin.xml"))
    other = mujoco.MjData(twin)
    mujoco.mj_kinematics(twin, other)
    np.testing.assert_allclose(data.xpos, other.xpos, atol=5e-3)


_KINDS = ("visual", "collision")
SHAPELESS = '<collision><geometry><mesh filename="{}"/></geometry></collision>'


@pytest.mark.parametrize("uri", ["package://elsewhere/hand.stl", "hand.dae", "file:///hand.glb"])
def test_meshes_that_are_missing_are_left_out_alone(uri: str, folder: Path, walk: Clip) -> None:
    text = (folder / "twin.urdf").read_text()
    at = text.index("</link>")
    (folder / "bare.urdf").write_text(text[:at] + SHAPELESS.format(uri) + text[at:])
    bare = understand_robot(folder / "bare.urdf")
    assert "1 mesh file left out" in " ".join(bare.notes)
    twin = known(folder / "twin.urdf")
    ours, theirs = (copy(walk.canonical, robot).qpos for robot in (bare, twin))
    np.testing.assert_allclose(ours, theirs, atol=1e-9)


def test_a_mesh_of_the_package_is_found(folder: Path) -> None:
    """In the folder of the package, above the model's; as STL that is text, and as COLLADA."""
    package = folder / "my_robot"
    (package / "meshes").mkdir(parents=True)
    (package / "urdf").mkdir()
    corners = [(0, 0, 0), (0.1, 0, 0), (0, 0.1, 0), (0, 0, 0.2)]
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    rows = [
        "outer loop\n" + "\n".join("vertex {} {} {}".format(*corners[k]) for k in face)
        for face in faces
    ]
    (package / "meshes" / "a.stl").write_text("solid a\n" + "\n".join(rows) + "\nendsolid")
    positions = " ".join(f"{100 * y} {100 * z} {100 * x}" for x, y, z in corners)
    (package / "meshes" / "b.dae").write_text(
        '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"><asset>'
        '<unit meter="0.01"/><up_axis>Z_UP</up_axis></asset><library_geometries>'
        '<geometry id="g"><mesh><source id="s"><float_array count="12">'
        f"{positions}</float_array></source>"
        '<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>'
        '<polylist count="4"><input semantic="VERTEX" source="#v" offset="0"/>'
        f"<vcount>3 3 3 3</vcount><p>{' '.join(str(k) for f in faces for k in f)}</p></polylist>"
        "</mesh></geometry></library_geometries><library_visual_scenes><visual_scene>"
        '<node><rotate>1 1 1 120</rotate><instance_geometry url="#g"/></node>'
        "</visual_scene></library_visual_scenes></COLLADA>"
    )
    text = (folder / "twin.urdf").read_text()
    at = text.index("</link>")
    seen = []
    for name in ("a.stl", "b.dae"):
        model = package / "urdf" / f"{name[0]}.urdf"
        shape = SHAPELESS.format(f"package://my_robot/meshes/{name}")
        model.write_text(text[:at] + shape + text[at:])
        read = read_mjcf(model)
        assert not any("left out" in note for note in read.notes)
        assert read.model.nmesh == 1
        mesh = read.model.mesh_vert + read.model.mesh_pos[0]
        seen.append(np.ptp(mesh, axis=0))
        np.testing.assert_allclose(sorted(seen[-1]), [0.1, 0.1, 0.2], atol=0.06)
    np.testing.assert_allclose(seen[0], seen[1], atol=1e-5)


def test_mimic_joints_follow(folder: Path, walk: Clip) -> None:
    text = (folder / "twin.urdf").read_text()
    tip = (
        '<link name="thumb"/><joint name="thumb_joint" type="revolute">'
        '<parent link="pelvis"/><child link="thumb"/><axis xyz="0 1 0"/>'
        '<limit lower="-9" upper="9" effort="1" velocity="1"/>'
        '<mimic joint="left_knee" multiplier="-0.5" offset="0.25"/></joint>'
    )
    (folder / "mimic.urdf").write_text(text.replace("</robot>", tip + "</robot>"))
    out = spark_sim.retarget(walk, folder / "mimic.urdf", method="copy")
    assert "1 joint follows another" in " ".join(known(folder / "mimic.urdf").notes)
    knee, thumb = out.joints["left_knee"], out.joints["thumb_joint"]
    assert np.ptp(knee) > 0.1
    np.testing.assert_allclose(thumb, 0.25 - 0.5 * knee, atol=1e-9)


def test_links_without_inertia_and_several_roots_are_read(folder: Path, walk: Clip) -> None:
    text = (folder / "twin.urdf").read_text()
    start, end = text.index("<inertial>"), text.index("</inertial>") + len("</inertial>")
    broken = text[:start] + text[end:]
    broken = broken.replace('ixx="', 'ixx="-', 1).replace(
        "</robot>", '<link name="crate"/></robot>'
    )
    (folder / "broken.urdf").write_text(broken)
    read = known(folder / "broken.urdf")
    assert "1 inertia that no body has, mended" in " ".join(read.notes)
    theirs = copy(walk.canonical, known(folder / "twin.urdf")).qpos
    ours = spark_sim.retarget(walk, folder / "broken.urdf", method="copy")
    assert isinstance(ours, spark_sim.RobotClip)
    np.testing.assert_allclose([*ours.joints.values()], theirs[:, 7:].T, atol=1e-9)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("</robot>", ""), r"twin\.urdf:\d+: is no XML"),
        (('<robot name="twin">', "<sdf><robot>"), "is no XML|begins with <sdf>"),
        (('<child link="left_', '<child link="lost_'), "which is no link of the file"),
        (('parent link="pelvis"', 'parent link="torso"'), "hang in a circle|MuJoCo can't"),
        (
            (
                '<link name="pelvis"',
                '<xacro:if xmlns:xacro="http://www.ros.org/wiki/xacro"/><link name="pelvis"',
            ),
            "expand them",
        ),
    ],
)
def test_what_is_no_tree_of_links_is_refused(
    change: tuple[str, str], says: str, folder: Path, tmp_path: Path
) -> None:
    text = (folder / "twin.urdf").read_text()
    assert change[0] in text
    (tmp_path / "twin.urdf").write_text(text.replace(*change))
    with pytest.raises((FileFormatError, SkeletonError), match=says):
        read_mjcf(tmp_path / "twin.urdf")


def test_an_inertia_without_end_is_mended(folder: Path, tmp_path: Path) -> None:
    text = re.sub(r'ixx="[^"]*"', 'ixx="1e308"', (folder / "twin.urdf").read_text(), count=1)
    (tmp_path / "twin.urdf").write_text(text)
    assert any(
        "1 inertia that no body has, mended" in n for n in read_mjcf(tmp_path / "twin.urdf").notes
    )


@pytest.mark.parametrize(
    "point", ['<sphere radius="0.00"/>', '<box size="0 0 0"/>', '<cylinder radius="0" length="0"/>']
)
def test_a_shape_without_size_is_no_shape(point: str, folder: Path, tmp_path: Path) -> None:
    """ARMAR-4 and Upkie have some, in the places of shapes to come."""
    text = (folder / "twin.urdf").read_text()
    shapes = "".join(f"<{kind}><geometry>{point}</geometry></{kind}>" for kind in _KINDS)
    (tmp_path / "twin.urdf").write_text(text.replace("</link>", f"{shapes}</link>"))
    plain, pointed = read_mjcf(folder / "twin.urdf"), read_mjcf(tmp_path / "twin.urdf")
    assert pointed.model.ngeom == plain.model.ngeom
    assert pointed.notes == plain.notes


def test_triples_with_commas_are_read(folder: Path, tmp_path: Path) -> None:
    """As ARMAR-6 has them."""
    text = (folder / "twin.urdf").read_text()
    commas = re.sub(r' xyz="(\S+) (\S+) (\S+)"', r' xyz="\1, \2,\3"', text)
    assert commas != text
    (tmp_path / "twin.urdf").write_text(commas)
    mended = read_mjcf(tmp_path / "twin.urdf")
    np.testing.assert_array_equal(
        mended.model.body_pos, read_mjcf(folder / "twin.urdf").model.body_pos
    )
    assert any("with commas" in note for note in mended.notes)


def test_a_chain_without_end_is_refused(tmp_path: Path) -> None:
    links = "".join(f'<link name="{k}"/>' for k in range(400))
    joint = '<joint name="j{0}" type="fixed"><parent link="{1}"/><child link="{0}"/></joint>'
    joints = "".join(joint.format(k, k - 1) for k in range(1, 400))
    (tmp_path / "long.urdf").write_text(f'<robot name="long">{links}{joints}</robot>')
    with pytest.raises(FileFormatError, match="nests links deeper than 200"):
        read_mjcf(tmp_path / "long.urdf")


def without_legs(text: str) -> str:
    """The twin with its legs cut off: a torso on a base."""
    import xml.etree.ElementTree as ET

    robot = ET.fromstring(text)
    joints = robot.findall("joint")
    gone = {j.find("child").get("link") for j in joints if "hip_pitch" in j.get("name", "")}
    while True:
        below = {
            j.find("child").get("link") for j in joints if j.find("parent").get("link") in gone
        }
        if below <= gone:
            break
        gone |= below
    for joint in joints:
        if joint.find("child").get("link") in gone:
            robot.remove(joint)
    for link in robot.findall("link"):
        if link.get("name") in gone:
            robot.remove(link)
    return ET.tostring(robot, encoding="unicode")


def test_a_robot_without_legs_stays_and_its_arms_follow(folder: Path, walk: Clip) -> None:
    (folder / "torso.urdf").write_text(without_legs((folder / "twin.urdf").read_text()))
    torso = known(folder / "torso.urdf")
    assert torso.mount is not None
    assert "no legs" in " ".join(torso.notes)
    wave = spark_sim.load(folder / "walker_wave.bvh").part(0.0, 1.5)
    assert isinstance(wave, Clip)
    whole, alone = (spark_sim.retarget(wave, folder / name) for name in ("twin.urdf", "torso.urdf"))
    assert np.ptp(alone.qpos[:, :7], axis=0).max() == 0
    off = [
        np.degrees(np.abs(alone.joints[name] - whole.joints[name]).mean())
        for name in alone.joints
        if "shoulder" in name or "elbow" in name
    ]
    assert np.mean(off) < 8  # the whole robot stands as the person does, and leans
    alone.save(folder / "alone.npz")
    again = spark_sim.load(folder / "alone.npz")
    assert isinstance(again, RobotClip)
    np.testing.assert_allclose(again.qpos, alone.qpos, atol=1e-6)
    assert again.contacts == {}
    with pytest.raises(ConventionError, match="has no legs"):
        spark_sim.Retargeter(wave, folder / "torso.urdf")


def test_who_walks_does_not_walk_in_place_on_a_robot_without_legs(folder: Path, walk: Clip) -> None:
    """It is its base that stays."""
    (folder / "torso.urdf").write_text(without_legs((folder / "twin.urdf").read_text()))
    out = spark_sim.retarget(walk, folder / "torso.urdf")
    assert not [note for note in out.notes if "in place" in note]


EXTRA = [e for e in registry.ENTRIES if e.requirement == "spark-sim[more-robots]"]


@pytest.mark.parametrize("entry", EXTRA, ids=[e.name for e in EXTRA])
def test_the_robots_of_the_extra_are_targets(entry: registry.Entry, walk: Clip) -> None:
    if entry.path is None:
        pytest.skip(f"{entry.name}: {entry.requirement} is not installed")
    robot = known(entry.name)
    legless = entry.name in ("alex", "baxter", "pr2", "tiago", "tiago_pro")
    assert (robot.mount is not None) == legless
    out = copy(walk.canonical, robot)
    limits = robot.tree.lower - 1e-9, robot.tree.upper + 1e-9
    led = [robot.mj_joints.index(pair[0]) for pair in robot.mjcf.followers()]
    own = [j for j in range(len(robot.tree)) if j not in led]
    angles = out.coordinates.angles[:, own]
    assert (angles >= limits[0][own]).all()
    assert (angles <= limits[1][own]).all()


def test_a_g1_is_a_g1_in_either_language() -> None:
    urdf = next(e for e in EXTRA if e.name == "g1_urdf")
    if urdf.path is None or registry.ENTRIES[1].path is None:
        pytest.skip("both G1s are needed")
    first, second = known("unitree_g1"), known("g1_urdf")
    assert first.joint_names == second.joint_names
    models = [robot.mjcf.model for robot in (first, second)]
    states = []
    for robot, model in zip((first, second), models, strict=True):
        data = mujoco.MjData(model)
        for k, joint in enumerate(robot.mj_joints):
            data.qpos[model.jnt_qposadr[joint]] = 0.3 * np.sin(k)
        mujoco.mj_kinematics(model, data)
        names = [first.mjcf.body_name(b) for b in first.mjcf.bodies()]
        root = data.body(names[0]).xpos
        states.append(np.array([data.body(name).xpos - root for name in names]))
    np.testing.assert_allclose(states[0], states[1], atol=2e-3)


@pytest.mark.parametrize(
    ("pattern", "by", "said"),
    [
        (r'lower="[^"]*"', 'lower="-1.57."', "lower='-1.57.'>: '-1.57.' is no number"),
        (r'axis xyz="[^"]*"', 'axis xyz="0 one 0"', "<axis xyz='0 one 0'>: 'one' is no number"),
    ],
)
def test_what_is_no_number_is_named_with_its_place(
    folder: Path, tmp_path: Path, pattern: str, by: str, said: str
) -> None:
    text = re.sub(pattern, by, (folder / "twin.urdf").read_text(), count=1)
    (tmp_path / "twin.urdf").write_text(text)
    with pytest.raises(FileFormatError, match="joint 'left_hip_pitch'") as error:
        read_mjcf(tmp_path / "twin.urdf")
    assert said in str(error.value)


def test_arms_that_hang_are_no_legs_whatever_tells_their_sides(folder: Path) -> None:
    """Numbers tell the sides, and the arms are the lowest limbs that there are."""
    text = without_legs((folder / "twin.urdf").read_text())
    for side, number in (("left", 0), ("right", 1)):
        text = re.sub(rf'"{side}_(\w+)"', rf'"arm_\1_n{number}"', text)
    (folder / "numbered.urdf").write_text(text)
    torso = known(folder / "numbered.urdf")
    assert torso.mount is not None
    left = torso.rig.roles.require(Role.LEFT_FOREARM)
    assert torso.rig.skeleton.names[left] == "arm_forearm_n0"
    assert torso.centers[left, 1] > 0
