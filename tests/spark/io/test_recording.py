"""From file numbers to SI motion and back: against an evaluation of BVH written out by hand."""

import warnings
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from spark.errors import ConventionError, SkeletonError
from spark.io.bvh import CHANNELS, Bvh, BvhJoint, write_bvh
from spark.io.convention import UNITS
from spark.io.encoding import encode, encode_new
from spark.io.euler import euler_over_time, quat_from_angles
from spark.io.recording import Recording, read_recording
from spark.kinematics import end_positions, forward
from spark.motion import Motion
from spark.skeleton import Skeleton
from tests.helpers.recordings import recording, recordings

XYZ = CHANNELS[:3]
ZXY = ("Zrotation", "Xrotation", "Yrotation")

# (joint, parent, where it lies in its parent): a human of 1.7 m standing in T, X forward, Z up [m].
HUMAN = [
    ("Hips", -1, (0.0, 0.0, 0.0)),
    ("Spine", 0, (0.0, 0.0, 0.15)),
    ("Neck", 1, (0.0, 0.0, 0.4)),
    ("Head", 2, (0.0, 0.0, 0.1)),
    ("LeftArm", 1, (0.0, 0.2, 0.35)),
    ("LeftHand", 4, (0.0, 0.55, 0.0)),
    ("RightArm", 1, (0.0, -0.2, 0.35)),
    ("RightHand", 6, (0.0, -0.55, 0.0)),
    ("LeftUpLeg", 0, (0.0, 0.1, 0.0)),
    ("LeftLeg", 8, (0.0, 0.0, -0.45)),
    ("LeftFoot", 9, (0.0, 0.0, -0.42)),
    ("LeftToe", 10, (0.15, 0.0, -0.06)),
    ("RightUpLeg", 0, (0.0, -0.1, 0.0)),
    ("RightLeg", 12, (0.0, 0.0, -0.45)),
    ("RightFoot", 13, (0.0, 0.0, -0.42)),
    ("RightToe", 14, (0.15, 0.0, -0.06)),
]
CROWN = (0.0, 0.0, 0.2)

# The file axes that hold internal X, Y, Z: "Y-up files: internal X, Y, Z = file Z, X, Y".
AXES_OF = {"x": (1, 2, 0), "y": (2, 0, 1), "z": (0, 1, 2)}


def to_file(vector: Sequence[float], up: str, unit_m: float) -> tuple[float, float, float]:
    placed = [0.0, 0.0, 0.0]
    for value, axis in zip(vector, AXES_OF[up], strict=True):
        placed[axis] = value / unit_m
    return placed[0], placed[1], placed[2]


def human(
    up: str = "y",
    unit_m: float = 0.01,
    *,
    root: Sequence[float] = (0.0, 0.0, 0.93),
    turns: np.ndarray | None = None,
    scale: float = 1.0,
) -> Bvh:
    """HUMAN as a file. `turns` are the root's channel angles (T 3), ZXY of the file's axes."""
    turns = np.zeros((3, 3)) if turns is None else turns
    joints = tuple(
        BvhJoint(
            name,
            parent,
            to_file(np.multiply(offset, scale), up, unit_m),
            ZXY if j else XYZ + ZXY,
            (to_file(np.multiply(CROWN, scale), up, unit_m),) if name == "Head" else (),
        )
        for j, (name, parent, offset) in enumerate(HUMAN)
    )
    values = np.zeros((len(turns), 3 + 3 * len(joints)))
    values[:, :3] = to_file(np.multiply(root, scale), up, unit_m)
    values[:, 3:6] = turns
    return Bvh(joints, 1 / 30, values)


def save(bvh: Bvh, folder: Path) -> Path:
    write_bvh(bvh, folder / "a.bvh")
    return folder / "a.bvh"


def by_hand(bvh: Bvh, frame: int, *, adds_offset: bool = False) -> np.ndarray:
    """Joint positions in file units and axes: one 4x4 matrix a channel, as the format defines."""
    matrices: list[np.ndarray] = []
    for joint, columns in zip(bvh.joints, bvh.columns, strict=True):
        place, turn = np.array(joint.offset), np.eye(4)
        for channel, value in zip(joint.channels, bvh.values[frame, columns], strict=True):
            axis = "XYZ".index(channel[0])
            if channel.endswith("rotation"):
                turn[:3, :3] @= Rotation.from_euler(channel[0], value, degrees=True).as_matrix()
            elif adds_offset and joint.parent >= 0:
                place[axis] += value
            else:
                place[axis] = value
        local = np.eye(4)
        local[:3, 3] = place
        parent = matrices[joint.parent] if joint.parent >= 0 else np.eye(4)
        matrices.append(parent @ local @ turn)
    return np.array([matrix[:3, 3] for matrix in matrices])


def zxy(rotation: Rotation) -> np.ndarray:
    """Its ZXY angles [degrees], at the singularity too."""
    with warnings.catch_warnings(action="ignore"):
        return rotation.as_euler("ZXY", degrees=True)


def assert_as_by_hand(found: Recording, atol: float = 1e-9) -> None:
    positions, _ = forward(found.motion)
    unit_m, up = found.convention.unit_m, found.convention.up
    for frame in {0, len(found.bvh) // 2, len(found.bvh) - 1}:
        expected = by_hand(found.bvh, frame, adds_offset=found.adds_offset)
        expected = expected[:, AXES_OF[up]] * unit_m
        np.testing.assert_allclose(positions[frame], expected, atol=atol)


# Reading


@pytest.mark.parametrize("path", recordings("zoo/*.bvh"))
def test_zoo_moves_as_the_format_defines(path: Path) -> None:
    found = read_recording(path)
    assert_as_by_hand(found)
    np.testing.assert_allclose(np.linalg.norm(found.motion.rotations, axis=-1), 1, atol=1e-12)
    assert found.motion.frame_time == found.bvh.frame_time


@pytest.mark.parametrize("up", ["x", "y", "z"])
@pytest.mark.parametrize("unit", ["cm", "m", "0.3"])
def test_any_unit_and_up_axis_give_the_same_motion(tmp_path: Path, up: str, unit: str) -> None:
    unit_m = UNITS.get(unit) or float(unit)
    found = read_recording(save(human(up, unit_m), tmp_path), unit=unit, up=up)
    positions, world = forward(found.motion)
    height = {"Hips": 0.93, "Head": 1.58, "LeftFoot": 0.06, "LeftHand": 1.43}
    for name, z in height.items():
        at = positions[0, found.motion.skeleton.names.index(name)]
        np.testing.assert_allclose(at, [0, {"LeftFoot": 0.1, "LeftHand": 0.75}.get(name, 0), z])
    toe = positions[0, found.motion.skeleton.names.index("LeftToe")]
    np.testing.assert_allclose(toe, [0.15, 0.1, 0.0], atol=1e-12)
    crown = end_positions(found.motion.skeleton, positions, world)[0, 0]
    np.testing.assert_allclose(crown, [0, 0, 1.78])
    assert found.notes == ()


@pytest.mark.parametrize("up", ["x", "y", "z"])
def test_rotations_turn_about_the_files_axes(tmp_path: Path, up: str) -> None:
    found = read_recording(save(human(up, turns=np.array([[30.0, -50.0, 70.0]])), tmp_path), up=up)
    assert_as_by_hand(found)


turn_channels = st.lists(st.sampled_from(CHANNELS[3:]), unique=True, max_size=3)


@given(
    turns=st.lists(turn_channels, min_size=3, max_size=3),
    places=st.lists(st.sets(st.sampled_from(XYZ)), min_size=3, max_size=3),
    turns_first=st.booleans(),
    up=st.sampled_from("xyz"),
    seed=st.integers(0, 999),
)
@settings(deadline=None, max_examples=100)
def test_any_channels_move_as_the_format_defines(
    tmp_path_factory: pytest.TempPathFactory,
    turns: list[list[str]],
    places: list[set[str]],
    turns_first: bool,
    up: str,
    seed: int,
) -> None:
    channels = [
        tuple(turn) + tuple(place) if turns_first else tuple(place) + tuple(turn)
        for turn, place in zip(turns, places, strict=True)
    ]
    channels[0] = channels[0] or ("Xposition",)
    rng = np.random.default_rng(seed)
    joints = tuple(
        BvhJoint(f"joint {j}", j - 1, (10.0 * j, 50.0, -5.0 * j), names)
        for j, names in enumerate(channels)
    )
    values = rng.uniform(-200, 200, (4, sum(map(len, channels))))
    path = save(Bvh(joints, 0.01, values), tmp_path_factory.mktemp("any"))
    found = read_recording(path, unit="cm", up=up)
    assert_as_by_hand(found)
    back, lost = encode(found.motion, found)
    assert lost == ()
    again = Recording(back, found.motion, found.convention, (), found.adds_offset)
    assert_as_by_hand(again, atol=1e-7)


def test_constant_positions_of_a_child_become_its_offset(tmp_path: Path) -> None:
    joints = (
        BvhJoint("root", -1, (0.0, 0.0, 0.0), ZXY),
        BvhJoint("hips", 0, (0.0, 50.0, 0.0), (*XYZ, *ZXY)),
        BvhJoint("foot", 1, (0.0, -90.0, 0.0), ("Yposition", "Xrotation")),
    )
    values = np.zeros((5, 11))
    values[:, 3:6] = 3.0, 90.0, 4.0
    values[:, 9] = -80.0
    motion = read_recording(save(Bvh(joints, 0.1, values), tmp_path), unit="cm", up="y").motion
    assert motion.translations is None
    np.testing.assert_allclose(motion.skeleton.offsets[1:], [[0.04, 0.03, 0.9], [0, 0, -0.8]])
    assert motion.skeleton.translating.tolist() == [True, True, True]

    values[:, 3] = [0.0, 2.0, 3.0, 7.0, 9.0]
    motion = read_recording(save(Bvh(joints, 0.1, values), tmp_path), unit="cm", up="y").motion
    assert motion.translations is not None
    np.testing.assert_allclose(motion.translations[:, 1, 1], values[:, 3] / 100)
    np.testing.assert_array_equal(motion.translations[:, 0], motion.root_pos)
    np.testing.assert_allclose(motion.skeleton.offsets[1], [0.04, 0.03, 0.9])  # the median


def test_positions_near_zero_on_most_joints_add_to_the_offset() -> None:
    """This file's offsets are a body in dm, its position channels 1e-5 of them: a body in T."""
    found = read_recording(recording("zoo/makehuman_tpose_163.bvh"))
    assert found.adds_offset
    assert "additions to the OFFSET" in " ".join(found.notes)
    positions, _ = forward(found.motion)
    at = dict(zip(found.motion.skeleton.names, positions[0], strict=True))
    assert 1.6 < np.ptp(positions[0, :, 2]) < 1.75
    assert 1.2 < np.linalg.norm(at["wrist.L"] - at["wrist.R"]) < 1.5
    assert abs(at["wrist.L"][2] - at["upperarm01.L"][2]) < 0.1


def test_a_hips_joint_that_crawls_does_not_add_to_its_offset(tmp_path: Path) -> None:
    joints = (
        BvhJoint("root", -1, (0.0, 0.0, 0.0), ZXY),
        BvhJoint("hips", 0, (0.0, 95.0, 0.0), (*XYZ, *ZXY)),
    )
    values = np.zeros((2, 9))
    values[:, 4] = 20.0
    found = read_recording(save(Bvh(joints, 0.1, values), tmp_path), unit="cm", up="y")
    assert not found.adds_offset
    assert found.motion.skeleton.offsets[1, 2] == pytest.approx(0.2)


def test_repeated_names_are_told_apart(tmp_path: Path) -> None:
    joints = tuple(
        BvhJoint(name, j - 1, (0.0, 9.0, 0.0), ZXY)
        for j, name in enumerate(["a", "toe", "toe", "toe.2", "toe", "toe.2"])
    )
    found = read_recording(save(Bvh(joints, 0.1, np.zeros((1, 18))), tmp_path), unit="cm", up="y")
    assert found.motion.skeleton.names == ("a", "toe", "toe.3", "toe.2", "toe.4", "toe.2.2")
    assert [joint.name for joint in found.bvh.joints].count("toe") == 3
    assert "repeated joint names" in found.notes[0]


def test_a_file_without_frames_is_its_rest_pose(tmp_path: Path) -> None:
    bvh = human()
    found = read_recording(save(Bvh(bvh.joints, 0.04, bvh.values[:0]), tmp_path))
    assert (found.convention.unit, found.convention.up) == ("cm", "y")
    assert "no frames" in found.notes[0]
    np.testing.assert_allclose(forward(found.motion)[0][0], found.motion.skeleton.rest_positions)


@pytest.mark.parametrize("frame_time", [30.0, 33e-6])
def test_a_frame_time_in_another_unit_is_pointed_out(tmp_path: Path, frame_time: float) -> None:
    bvh = human()
    found = read_recording(save(Bvh(bvh.joints, frame_time, bvh.values), tmp_path))
    assert f"a frame lasts {frame_time:g} s" in found.notes[0]


# Inference of unit and up axis

# What each set is, as its README says. fair1 is about 3.5 to 4 cm: between inch and CMU's unit.
CONVENTIONS = {
    "cmu_asf/*": ("cm", "y"),
    "cmu_expmap/*": ("cmu", "y"),
    "reactidle/*": ("m", "y"),
    "mesh2motion/*": ("m", "y"),
    "makehuman/*": ("dm", "z"),
    "animateddrawings/jesse_dance": ("cm", "y"),
    "animateddrawings/jumping_jacks": ("cmu", "y"),
    "animateddrawings/dab": ("cmu", "z"),
    "zoo/ad_cmu1": ("cmu", "y"),
    "zoo/ad_fair1_zup": ("cmu", "z"),
    "zoo/ad_rokoko_mixamo": ("cm", "y"),
    "zoo/cmu_asf_cm": ("cm", "y"),
    "zoo/cmu_cgspeed_31j": ("cmu", "y"),
    "zoo/cmu_max_131": ("cmu", "y"),
    "zoo/cmu_scaled_metre": ("m", "y"),
    "zoo/m2m_*": ("m", "y"),
    "zoo/makehuman_*": ("dm", "z"),
    "zoo/reactidle_blender": ("m", "y"),
}


@pytest.mark.parametrize("pattern", CONVENTIONS)
def test_conventions_of_recordings_are_inferred(pattern: str) -> None:
    folder = recording(pattern).parent
    paths = sorted(folder.glob(recording(pattern).name + ".bvh"))
    assert paths
    for path in paths[:: 1 + len(paths) // 12]:
        found = read_recording(path)
        assert (found.convention.unit, found.convention.up) == CONVENTIONS[pattern], path


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("tall", [1.3, 1.5, 1.8, 2.0])
def test_people_of_all_sizes_show_the_unit(tmp_path: Path, unit: str, tall: float) -> None:
    found = read_recording(save(human("z", UNITS[unit], scale=tall / 1.7), tmp_path))
    assert (found.convention.unit, found.convention.up) == (unit, "z")
    assert f"unit {unit} " in found.notes[0]


def test_a_size_between_two_units_is_pointed_out(tmp_path: Path) -> None:
    found = read_recording(save(human("y", 0.0375), tmp_path))
    assert {found.convention.unit, "inch"} == {"cmu", "inch"}
    assert "unit inch (1.10 m) is nearly as likely" in " ".join(found.notes)


def test_a_height_no_human_has_is_pointed_out(tmp_path: Path) -> None:
    found = read_recording(save(human("y", 1.0, scale=60), tmp_path), up="y")
    assert found.convention.unit == "cm"
    found = read_recording(save(human("y", 1.0, scale=3), tmp_path), up="y")
    assert "no human's height" in " ".join(found.notes)


@pytest.mark.parametrize(("rest", "up"), [("z", "y"), ("x", "y"), ("y", "z")])
def test_the_motion_and_not_the_rest_pose_shows_what_is_up(
    tmp_path: Path, rest: str, up: str
) -> None:
    """The rest pose stands along `rest`; the root's rotation stands it along `up`."""
    bvh = human(rest)
    turn = Rotation.align_vectors([np.eye(3)["xyz".index(up)]], [np.eye(3)["xyz".index(rest)]])[0]
    values = bvh.values.copy()
    values[:, :3] = to_file((0.3, 0.5, 0.93), up, 0.01)
    values[:, 3:6] = zxy(turn)
    found = read_recording(save(Bvh(bvh.joints, 0.1, values), tmp_path))
    assert found.convention.up == up
    positions, _ = forward(found.motion)
    assert positions[0, 3, 2] - positions[0, 10, 2] == pytest.approx(1.52)  # head above foot


@pytest.mark.parametrize("heading", [0.0, 30.0, 45.0, 90.0])
def test_a_body_that_lies_on_the_floor_does_not_turn_the_world(
    tmp_path: Path, heading: float
) -> None:
    lying = Rotation.from_euler("Y", heading, degrees=True) * Rotation.from_euler("X", np.pi / 2)
    turns = np.tile(zxy(lying), (4, 1))
    found = read_recording(save(human("y", turns=turns, root=(1.3, 2.2, 0.15)), tmp_path))
    assert found.convention.up == "y"


def test_what_cannot_be_known_is_called_a_guess(tmp_path: Path) -> None:
    bvh = human()
    joints = tuple(BvhJoint(f"b{j}", *_rest(joint)) for j, joint in enumerate(bvh.joints))
    notes = " ".join(read_recording(save(Bvh(joints, 0.1, bvh.values), tmp_path)).notes)
    assert "judged by its longest chain of bones" in notes
    assert "up axis y, a guess" in notes


def _rest(joint: BvhJoint) -> tuple[object, ...]:
    return joint.parent, joint.offset, joint.channels, joint.ends


def test_a_body_upside_down_is_pointed_out(tmp_path: Path) -> None:
    turns = np.tile([0.0, 180.0, 0.0], (4, 1))
    found = read_recording(save(human("y", turns=turns, root=(3.0, 2.0, 1.7)), tmp_path))
    assert found.convention.up == "y"
    assert "upside down along y; check, and give --up" in found.notes[-1]


def test_a_skeleton_in_one_point_needs_a_unit(tmp_path: Path) -> None:
    path = save(human(scale=0.0), tmp_path)
    with pytest.raises(ConventionError, match=f"{path}: all joints lie in one point.*--unit"):
        read_recording(path)
    assert read_recording(path, unit="m", up="y").motion.skeleton.offsets.max() == 0.0


@pytest.mark.parametrize("unit", ["yard", "", "nan", "-1", "0", 0.0, float("inf")])
def test_unknown_units_are_refused(tmp_path: Path, unit: str | float) -> None:
    with pytest.raises(ConventionError, match="expected one of m, cm, cmu, inch, mm, dm"):
        read_recording(tmp_path / "never read", unit=unit)


def test_unknown_axes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConventionError, match="expected one of x, y, z"):
        read_recording(tmp_path / "never read", up="w")


# Writing


@pytest.mark.parametrize("path", recordings("zoo/*.bvh"))
def test_zoo_motions_come_back_from_their_own_file(tmp_path: Path, path: Path) -> None:
    first = read_recording(path)
    bvh, lost = encode(first.motion, first)
    assert lost == ()
    write_bvh(bvh, tmp_path / "b.bvh")
    convention = first.convention
    again = read_recording(tmp_path / "b.bvh", unit=convention.unit_m, up=convention.up)
    expected, _ = forward(first.motion)
    positions, _ = forward(again.motion)
    height = np.ptp(expected[..., 2], axis=1).max()
    np.testing.assert_allclose(positions, expected, atol=1e-6 * height)
    assert again.motion.frame_time == first.motion.frame_time
    assert [joint.channels for joint in bvh.joints] == [j.channels for j in first.bvh.joints]
    # No angle jumps over whole turns.
    for _, columns in bvh.rotation_channels.values():
        assert np.abs(np.diff(bvh.values[:, columns], axis=0)).max(initial=0) < 270


@pytest.mark.parametrize("path", recordings("zoo/*.bvh"))
@pytest.mark.parametrize(("unit", "up"), [("cm", "y"), ("m", "z")])
def test_zoo_motions_come_back_from_a_new_file(
    tmp_path: Path, path: Path, unit: str, up: str
) -> None:
    first = read_recording(path).motion
    write_bvh(encode_new(first, unit=unit, up=up), tmp_path / "b.bvh")
    again = read_recording(tmp_path / "b.bvh", unit=unit, up=up).motion
    expected, _ = forward(first)
    positions, _ = forward(again)
    np.testing.assert_allclose(
        positions, expected, atol=2e-6 * np.ptp(expected[..., 2], axis=1).max()
    )
    assert again.skeleton.names == first.skeleton.names
    np.testing.assert_allclose(again.skeleton.end_offsets, first.skeleton.end_offsets, atol=1e-8)


def test_a_new_file_nests_joints_of_any_order(tmp_path: Path) -> None:
    """The skeleton's joints come by level, one name can't stand in a file, one joint slides."""
    rng = np.random.default_rng(0)
    skeleton = Skeleton(
        ("root", "a{b}", "c", "a1", "c1"),
        np.array([-1, 0, 0, 1, 2]),
        rng.normal(size=(5, 3)),
        np.array([True, False, False, False, False]),
        np.array([4, 3]),
        rng.normal(size=(2, 3)),
    )
    rotations = Rotation.random(20, random_state=0).as_quat(scalar_first=True).reshape(4, 5, 4)
    slides = np.repeat(skeleton.offsets[None], 4, axis=0)
    slides[:, 0], slides[:, 3, 1] = rng.normal(size=(4, 3)), rng.normal(size=4)
    motion = Motion(skeleton, 0.01, slides[:, 0], rotations, slides)
    bvh = encode_new(motion, unit="inch", up="x")
    assert [joint.name for joint in bvh.joints] == ["root", "a_b_", "a1", "c", "c1"]
    assert [len(joint.channels) for joint in bvh.joints] == [6, 3, 6, 3, 3]
    again = read_recording(save(bvh, tmp_path), unit="inch", up="x").motion
    positions, world = forward(again)
    expected, expected_world = forward(motion)
    np.testing.assert_allclose(positions[:, [0, 1, 3, 2, 4]], expected, atol=1e-7)
    ends = end_positions(again.skeleton, positions, world)
    expected_ends = end_positions(skeleton, expected, expected_world)
    np.testing.assert_allclose(ends[:, [1, 0]], expected_ends, atol=1e-7)


def limited() -> Bvh:
    """A root that only turns, a knee with one axis, a foot with none."""
    joints = (
        BvhJoint("hips", -1, (0.0, 90.0, 0.0), ZXY),
        BvhJoint("knee", 0, (0.0, -45.0, 0.0), ("Xrotation",)),
        BvhJoint("foot", 1, (0.0, -40.0, 0.0), ()),
    )
    return Bvh(joints, 0.1, np.array([[10.0, 20, 30, 100], [10, 20, 30, -179], [10, 20, 30, -190]]))


def test_what_channels_cannot_express_is_said(tmp_path: Path) -> None:
    template = read_recording(save(limited(), tmp_path), unit="cm", up="y")
    motion = template.motion
    bvh, lost = encode(motion, template)
    assert lost == ()
    np.testing.assert_allclose(bvh.values[:, 3], [100, 181, 170])  # no whole turns

    turned = motion.rotations.copy()
    turned[1, 2] = Rotation.from_euler("x", 0.5, degrees=True).as_quat(scalar_first=True)
    _, lost = encode(Motion(motion.skeleton, 0.1, motion.root_pos, turned), template)
    assert lost == ("no rotation channels for all that 'foot' turn: up to 0.5 degrees are lost",)

    turned = motion.rotations.copy()
    sideways = Rotation.from_euler("xz", [40, 3], degrees=True).as_quat(scalar_first=True)
    turned[:, 1] = sideways[[0, 3, 1, 2]]  # internal y is the file's x
    _, lost = encode(Motion(motion.skeleton, 0.1, motion.root_pos, turned), template)
    assert "'knee'" in lost[0]

    moved = motion.root_pos + np.array([0, 0, 0.125])
    _, lost = encode(Motion(motion.skeleton, 0.1, moved, motion.rotations), template)
    assert lost == (
        "no position channels for where 'hips' lie in their parents: up to 0.125 m are lost",
    )


def test_a_motion_of_other_joints_is_refused(tmp_path: Path) -> None:
    template = read_recording(save(limited(), tmp_path), unit="cm", up="y")
    other = read_recording(save(human(), tmp_path)).motion
    with pytest.raises(SkeletonError, match=r"16 joints.* the file 3, from 'hips' to 'foot'"):
        encode(other, template)


# Euler angles over time

orders = st.permutations("xyz").map("".join)


@given(order=orders, seed=st.integers(0, 9999), speed=st.sampled_from([0.02, 0.3, 3.0]))
@settings(deadline=None, max_examples=60)
def test_angles_give_the_rotation_and_take_the_nearer_solution(
    order: str, seed: int, speed: float
) -> None:
    rng = np.random.default_rng(seed)
    steps = Rotation.from_rotvec(speed * rng.normal(size=(40, 3)))
    path = [Rotation.random(random_state=seed)]
    for step in steps:
        path.append(path[-1] * step)
    q = Rotation.concatenate(path).as_quat(scalar_first=True)
    angles = euler_over_time(q, order)
    back = Rotation.from_euler(order.upper(), angles)
    assert (back * Rotation.concatenate(path).inv()).magnitude().max() < 1e-9

    # The same, one frame after the other: of both solutions the one with the smaller change.
    expected = [angles[0]]
    for rotation in path[1:]:
        first = rotation.as_euler(order.upper())
        both = [first, np.array([first[0] + np.pi, np.pi - first[1], first[2] + np.pi])]
        near = [e + 2 * np.pi * np.round((expected[-1] - e) / (2 * np.pi)) for e in both]
        expected.append(min(near, key=lambda e: np.abs(e - expected[-1]).sum()))
    np.testing.assert_allclose(angles, expected, atol=1e-6)


@pytest.mark.parametrize("order", ["xyz", "xzy", "yxz", "yzx", "zxy", "zyx"])
def test_angles_run_through_the_singularity(order: str) -> None:
    """The middle angle turns right round, and stands still exactly at 90 degrees for a while."""
    middle = np.concatenate([np.linspace(0, 90, 46), np.full(9, 90.0), np.linspace(90, 400, 156)])
    expected = np.radians(
        np.stack([np.full_like(middle, 25), middle, np.full_like(middle, -40)], 1)
    )
    q = Rotation.from_euler(order.upper(), expected).as_quat(scalar_first=True)
    np.testing.assert_allclose(euler_over_time(q, order), expected, atol=1e-6)


@pytest.mark.parametrize("order", ["x", "y", "z", "xy", "zx", "yz", "xz"])
def test_fewer_axes_give_their_own_angles_back(order: str) -> None:
    expected = np.linspace(-1, 1, 80)[:, None] * np.array([7.0, -3.0])[: len(order)]
    angles = euler_over_time(quat_from_angles(expected, order), order)
    whole_turns = (angles - expected) / (2 * np.pi)
    np.testing.assert_allclose(
        whole_turns, np.broadcast_to(np.round(whole_turns[0]), whole_turns.shape), atol=1e-9
    )
