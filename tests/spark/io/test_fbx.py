"""FBX: small files with answers worked by hand, and what Mixamo exports."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import spark_sim
from spark.errors import ConventionError, DependencyError, FileFormatError
from spark.io.fbx import read_fbx
from spark.io.fbx_scene import FbxScene
from spark.io.fbx_settings import read_settings
from spark.kinematics import forward
from spark.rig.rig import understand
from spark.rotation import quat_angle, quat_identity
from spark_sim import Clip
from spark_sim.character_files import lacking
from tests.helpers.fbx_text import Fbx, Node, Take
from tests.helpers.recordings import recording, recordings

pytest.importorskip("pufbx")

# A body of two bones that turns by 90 degrees about its own y axis in one second. The first bone
# lies by its pre-rotation: its x axis points up, so that the second bone is 10 above the first.
ARM = [
    Node("Hips", translation=(0, 100, 0), pre_rotation=(0, 0, 90)),
    Node("Spine", 0, translation=(10, 0, 0)),
]
TURN = Take("turn", node=0, axis="Y", times=(0, 1), angles=(0, 90))

# Of FBX 6.1 as programs wrote it until 2010: links by names, takes, and the rate as a text.
SIX = """; FBX 6.1.0 project file
FBXHeaderExtension: { FBXVersion: 6100
}
Objects: {
 Model: "Model::Hips", "Limb" { Version: 232
  Properties60: { Property: "Lcl Translation", "Lcl Translation", "A+",0,100,0
  } }
 Model: "Model::Spine", "Limb" { Version: 232
  Properties60: { Property: "Lcl Translation", "Lcl Translation", "A+",0,10,0
  } }
 GlobalSettings: { Version: 1000
  Properties60: { Property: "UpAxis", "int", "",1
   Property: "UnitScaleFactor", "double", "",1
  } } }
Connections: {
 Connect: "OO", "Model::Hips", "Model::Scene"
 Connect: "OO", "Model::Spine", "Model::Hips"
}
Takes: { Current: "walk"
 Take: "walk" { LocalTime: 0,46186158000
  Model: "Model::Hips" { Version: 1.1
   Channel: "Transform" { Channel: "R" { Channel: "X" { Default: 0
     KeyVer: 4005
     KeyCount: 2
     Key: 0,0,L,46186158000,90,L
     } LayerType: 2
    } LayerType: 1
   } } } }
Version5: { Settings: { FrameRate: "24"
 } }
"""


def test_pre_rotations_and_axes(tmp_path: Path) -> None:
    read = read_fbx(Fbx(ARM, [TURN]).write(tmp_path / "a.fbx"))
    motion = read.motion
    assert motion.frame_time == 1 / 30
    assert len(motion) == 31
    assert motion.translations is None
    np.testing.assert_allclose(motion.skeleton.rest_positions, [[0, 0, 1], [0, 0, 1.1]], atol=1e-12)
    np.testing.assert_allclose(motion.rotations[0], [[1, 0, 0, 0]] * 2, atol=1e-9)
    # Rz(90) Ry(90) (10, 0, 0) = (0, 0, -10) in the file: Z there is our X.
    positions, world = forward(motion)
    np.testing.assert_allclose(positions[-1], [[0, 0, 1], [-0.1, 0, 1]], atol=1e-9)
    # About the file's -X, which is our -Y.
    half = np.sqrt(0.5)
    np.testing.assert_allclose(world[-1], [[half, 0, -half, 0]] * 2, atol=1e-9)
    # Keys at both ends, linear between: a third of the way is 30 degrees.
    angle = np.degrees(quat_angle(quat_identity(world[10]), world[10]))
    np.testing.assert_allclose(angle, 30, atol=1e-6)


def test_what_the_file_says_of_itself(tmp_path: Path) -> None:
    nodes = [Node("Hips", translation=(1, 2, 3)), Node("Spine", 0, translation=(0, 0, 1))]
    file = Fbx(nodes, [TURN], axes=(0, 2, 1), signs=(1, 1, -1), unit_cm=100, time_mode=11)
    read = read_fbx(file.write(tmp_path / "z.fbx"))
    assert (read.convention.up, read.convention.unit_m) == ("z", 1.0)
    assert read.motion.frame_time == 1 / 24
    assert len(read.motion) == 25
    np.testing.assert_allclose(read.motion.skeleton.rest_positions[0], [1, 2, 3])
    assert "unit 100 cm, as the file says" in read.notes
    given = read_fbx(tmp_path / "z.fbx", unit="cm", up="y")
    np.testing.assert_allclose(given.motion.skeleton.rest_positions[0], [0.03, 0.01, 0.02])
    custom = replace(file, time_mode=14, rate=12.5)
    assert read_fbx(custom.write(tmp_path / "c.fbx")).motion.frame_time == 0.08


def test_nodes_that_are_no_joints(tmp_path: Path) -> None:
    """An armature of Blender's, scaled and turned, above the bones; an empty node between them."""
    nodes = [
        Node("Armature", kind="Null", rotation=(-90, 0, 0), scale=(100, 100, 100)),
        Node("Hips", 0, translation=(0, 0, 1)),
        Node("shift", 1, kind="Null", translation=(0, 0, 0.25)),
        Node("Spine", 2, translation=(0, 0, 0.25)),
        Node("Camera", -1, kind="Camera", translation=(500, 0, 0)),
    ]
    take = Take("turn", node=1, axis="X", times=(0, 0.5), angles=(0, 90))
    motion = read_fbx(Fbx(nodes, [take]).write(tmp_path / "b.fbx")).motion
    assert motion.skeleton.names == ("Hips", "shift", "Spine")
    expected = [[0, 0, 1], [0, 0, 1.25], [0, 0, 1.5]]
    np.testing.assert_allclose(motion.skeleton.rest_positions, expected, atol=1e-9)
    # In the armature's axes (0, 0, 0.5) turns to (0, -0.5, 0): 50 cm along the file's +Z.
    np.testing.assert_allclose(forward(motion)[0][-1, 2], [0.5, 0, 1], atol=1e-9)


def test_mirrored_and_growing_nodes_still_turn(tmp_path: Path) -> None:
    """A rest pose that holds a mirror gives rotations all the same."""
    nodes = [replace(ARM[0], scale=(-2, 2, 2)), ARM[1]]
    motion = read_fbx(Fbx(nodes, [TURN]).write(tmp_path / "m.fbx")).motion
    np.testing.assert_allclose(np.linalg.norm(motion.rotations, axis=-1), 1, atol=1e-9)
    # -2 * 10 along the first bone's x axis, which points up at rest: 20 cm below.
    np.testing.assert_allclose(motion.skeleton.rest_positions[1], [0, 0, 0.8], atol=1e-9)
    np.testing.assert_allclose(forward(motion)[0][-1, 1], [0.2, 0, 1], atol=1e-9)


def test_an_empty_animation_beside_the_real_one(tmp_path: Path) -> None:
    read = read_fbx(Fbx(ARM, [Take("Take 001"), TURN]).write(tmp_path / "a.fbx"))
    assert len(read.motion) == 31
    assert "animation 'turn' is read, not 'Take 001'" in read.notes


def test_a_longer_animation_of_which_nothing_moves(tmp_path: Path) -> None:
    """As Blender writes one for each action, also those of a camera, with keys for all bones."""
    still = Take("camera", times=(0, 5), angles=(30, 30))
    read = read_fbx(Fbx(ARM, [still, TURN]).write(tmp_path / "a.fbx"))
    assert len(read.motion) == 31
    assert "animation 'turn' is read, not 'camera'" in read.notes
    assert len(read_fbx(tmp_path / "a.fbx", clip="camera").motion) == 151


def test_without_animation_or_bones(tmp_path: Path) -> None:
    nulls = [replace(node, kind="Null") for node in ARM]
    read = read_fbx(Fbx(nulls).write(tmp_path / "n.fbx"))
    assert len(read.motion) == 1
    assert any("nothing moves" in note for note in read.notes)
    assert any("no node is a bone" in note for note in read.notes)
    with pytest.raises(FileFormatError, match="holds no skeleton"):
        read_fbx(Fbx([]).write(tmp_path / "none.fbx"))


def test_lights_and_cameras_are_no_joints(tmp_path: Path) -> None:
    """Neither beside empty nodes, nor alone."""
    lamps = [Node("Lamp", kind="Light", translation=(0, 300, 0)), Node("View", kind="Camera")]
    nulls = [replace(node, kind="Null") for node in ARM]
    read = read_fbx(Fbx([*nulls, *lamps], [TURN]).write(tmp_path / "lit.fbx"))
    assert read.motion.skeleton.names == ("Hips", "Spine")
    assert len(read.motion) == 31
    with pytest.raises(FileFormatError, match="holds no skeleton"):
        read_fbx(Fbx(lamps).write(tmp_path / "lamps.fbx"))


def test_the_largest_skeleton(tmp_path: Path) -> None:
    read = read_fbx(
        Fbx([Node("Prop"), *[replace(n, parent=n.parent + (n.parent >= 0)) for n in ARM]]).write(
            tmp_path / "two.fbx"
        )
    )
    assert read.motion.skeleton.names == ("Hips", "Spine")
    assert any("'Prop'" in note for note in read.notes)


@pytest.mark.parametrize(
    ("up", "axes", "signs"),
    [("-y", (0, 1, 2), (-1, -1, 1)), ("-z", (0, 2, 1), (1, -1, 1)), ("-x", (1, 0, 2), (1, -1, 1))],
)
def test_axes_that_point_down(
    tmp_path: Path, up: str, axes: tuple[int, int, int], signs: tuple[int, int, int]
) -> None:
    """Points of a body to its side, above it and in front give the same body whatever the axes."""

    def place(side: float, above: float, front: float) -> tuple[float, float, float]:
        at = dict(zip(axes, np.array(signs) * (side, above, front), strict=True))
        return at[0], at[1], at[2]

    nodes = [
        Node("Hips", translation=place(0, 100, 0)),
        Node("Spine", 0, translation=place(0, 10, 0)),
        Node("Nose", 1, translation=place(0, 5, 4)),
        Node("Hand", 1, translation=place(3, 0, 0)),
    ]
    read = read_fbx(Fbx(nodes, axes=axes, signs=signs).write(tmp_path / "d.fbx"))
    assert read.convention.up == up
    places = read.motion.skeleton.rest_positions
    np.testing.assert_allclose(places[:, 2], [1, 1.1, 1.15, 1.1], atol=1e-12)
    front, side = places[2, :2], places[3, :2]
    # Side, up and front are right-handed, as x, y and z: front x side is up.
    assert np.cross([*front, 0], [*side, 0])[2] == pytest.approx(0.04 * 0.03)


def test_fbx_6_says_its_frame_rate_elsewhere(tmp_path: Path) -> None:
    (tmp_path / "six.fbx").write_text(SIX)
    motion = read_fbx(tmp_path / "six.fbx").motion
    assert motion.fps == pytest.approx(24)
    assert len(motion) == 25
    np.testing.assert_allclose(forward(motion)[0][[0, -1], 1], [[0, 0, 1.1], [0.1, 0, 1]])
    binary = b"Kaydara FBX Binary  \0\x1a\0..\x09FrameRateS\x05\0\0\x0029.97"
    assert read_settings(binary).frame_time == 1 / 29.97


def test_bones_that_hang_side_by_side(tmp_path: Path) -> None:
    apart = [replace(node, parent=-1) for node in ARM]
    with pytest.raises(FileFormatError, match=r"a\.fbx: has 2 bones .*'Hips'.*hierarchy"):
        read_fbx(Fbx(apart, [TURN]).write(tmp_path / "a.fbx"))


@pytest.mark.parametrize("data", [b"", b"HIERARCHY", b"Kaydara FBX Binary  \0\x1a\0" + bytes(40)])
def test_what_is_no_fbx(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "x.fbx").write_bytes(data)
    with pytest.raises(FileFormatError, match=re.escape(str(tmp_path / "x.fbx"))):
        read_fbx(tmp_path / "x.fbx")
    with pytest.raises(FileFormatError, match="no such file"):
        read_fbx(tmp_path / "nowhere.fbx")


@pytest.mark.parametrize(
    ("axes", "signs"), [((0, 1, 2), (1, -1, 1)), ((0, 1, 2), (1, 1, -1)), ((0, 1, 1), (1, 1, 1))]
)
def test_axes_that_are_refused(
    tmp_path: Path, axes: tuple[int, int, int], signs: tuple[int, int, int]
) -> None:
    with pytest.raises(ConventionError, match=r"a\.fbx: .*expected"):
        read_fbx(Fbx(ARM, [TURN], axes=axes, signs=signs).write(tmp_path / "a.fbx"))


def test_without_the_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pufbx", None)
    with pytest.raises(DependencyError, match=r"pip install 'spark-sim\[fbx\]'"):
        read_fbx(Fbx(ARM, [TURN]).write(tmp_path / "a.fbx"))


def test_truncated_files(tmp_path: Path) -> None:
    """A file that ends early is refused with its name, or gives what it still holds."""
    data = recording("mixamo/Castle_Guard_01/sword_and_shield_walk_34f.fbx").read_bytes()
    for share in np.linspace(0.01, 0.99, 25):
        (tmp_path / "t.fbx").write_bytes(data[: int(share * len(data))])
        with pytest.raises((FileFormatError, ConventionError), match=r"t\.fbx"):
            read_fbx(tmp_path / "t.fbx")


# Frames, frame rate and joints, and the hips' first key and resting place [m], as the files' own
# curves and nodes have them (in centimetres, Y up, there).
EXPORTS = {
    "Amy/hip_hop_dancing_101f": (102, 30, 65),
    "Big_Vegas/mutant_swiping_81f": (81, 30, 86),
    "Castle_Guard_01/sword_and_shield_walk_34f": (34, 30, 41),
    "Kaya/rumba_dancing_72f": (143, 60, 79),
    "Kaya/silly_dancing_115f": (230, 60, 79),
    "Michelle/rumba_dancing_72f": (72, 30, 65),
    "Michelle/silly_dancing_115f": (116, 30, 65),
    "Sporty_Granny/rumba_dancing_72f": (72, 30, 99),
    "Warrok_W_Kurniawan/mutant_swiping_81f": (81, 30, 81),
    "XBot/silly_dancing_115f": (230, 60, 65),
}
ROLES = {
    "Spine": "spine", "Spine1": "spine", "Spine2": "spine", "Neck": "neck", "Head": "head",
    **{
        f"{side}{name}": f"{side.lower()}_{role}"
        for side in ("Left", "Right")
        for name, role in {
            "Shoulder": "clavicle", "Arm": "upper_arm", "ForeArm": "forearm", "Hand": "hand",
            "UpLeg": "upper_leg", "Leg": "lower_leg", "Foot": "foot", "ToeBase": "toe",
        }.items()
    },
}  # fmt: skip


@pytest.mark.parametrize("path", recordings("mixamo/*/*.fbx"))
def test_mixamo(path: Path) -> None:
    read = read_fbx(path)
    motion, skeleton = read.motion, read.motion.skeleton
    frames, fps, joints = EXPORTS[f"{path.parent.name}/{path.stem}"]
    assert (len(motion), round(motion.fps, 9), len(skeleton)) == (frames, fps, joints)
    assert read.convention.unit == "cm"
    assert read.convention.up == "y"

    rig = understand(motion)
    found = {
        name.rpartition(":")[2]: str(role)
        for name, role in zip(skeleton.names, rig.roles.roles, strict=True)
        if role is not None
    }
    pelvis = "Pelvis" if "Pelvis" in skeleton.names else "Hips"
    assert found == {**ROLES, pelvis: "pelvis"}
    # The rest pose is Mixamo's T-pose: the body stands on the floor and its arms point sideways.
    rest = dict(
        zip((n.rpartition(":")[2] for n in skeleton.names), skeleton.rest_positions, strict=True)
    )
    assert abs(rest["LeftToeBase"][2]) < 0.12
    span = rest["LeftHand"] - rest["LeftArm"]
    assert span[1] > 0.97 * np.linalg.norm(span)
    assert 0.4 < rig.hip_height < 1.1

    # Our joints go where the file's nodes go.
    scene = FbxScene(path)
    nodes, _ = scene.joints()
    baked, times, _ = scene.animation(motion.frame_time)
    in_file, _ = scene.world(nodes, baked, times)
    np.testing.assert_allclose(forward(motion)[0], in_file[..., [2, 0, 1]] / 100, atol=1e-4)


def test_xbot_by_hand() -> None:
    """Numbers read off the file's own curves."""
    read = read_fbx(recording("mixamo/XBot/silly_dancing_115f.fbx"))
    first = read.motion.root_pos[0]
    np.testing.assert_allclose(first, [0.0208989525, -0.0086357254, 0.9101451874], atol=1e-9)
    rest = read.motion.skeleton.rest_positions[0]
    np.testing.assert_allclose(rest, [0.0155431581, 0, 1.0427487183], atol=1e-7)
    assert "animation 'mixamo.com' is read, not 'Take 001'" in read.notes


def test_retarget_from_and_to_fbx(tmp_path: Path) -> None:
    source = recording("mixamo/Michelle/rumba_dancing_72f.fbx")
    result = spark_sim.retarget(source, recording("mixamo/XBot/silly_dancing_115f.fbx"))
    assert isinstance(result, Clip)
    (note,) = lacking(result.body_file, tmp_path / "out.bvh")
    assert "BVH of its own" in note
    assert not lacking(result.body_file, tmp_path / "out.glb")
    again = spark_sim.load(result.save(tmp_path / "out.bvh"))
    assert again.motion.skeleton.names == result.motion.skeleton.names
    np.testing.assert_allclose(forward(again.motion)[0], forward(result.motion)[0], atol=1e-5)


@pytest.mark.parametrize(("times", "rate"), [((0, 86400.0), 30.0), ((0, 1.1), 90_000.0)])
def test_keys_far_apart_are_no_recording(
    times: tuple[float, float], rate: float, tmp_path: Path
) -> None:
    """A day of two keys, and a second at 90 kHz: refused before their frames are made."""
    nodes = [Node(f"n{k}", k - 1, (0, 10, 0)) for k in range(30)]
    takes = [Take("Take 001", 1, "X", times, (0, 90))]
    path = Fbx(nodes, takes, time_mode=14, rate=rate).write(tmp_path / "long.fbx")
    with pytest.raises(FileFormatError, match=r"frames of 31 nodes; a file of its size holds no"):
        read_fbx(path)
    near = [Take("Take 001", 1, "X", (0, 1), (0, 90))]
    assert len(read_fbx(Fbx(nodes, near, time_mode=14, rate=30.0).write(path)).motion) == 31
