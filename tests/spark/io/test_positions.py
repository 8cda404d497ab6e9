"""Positions alone: forward kinematics of the answer meets them, and bodies turn as they were."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import spark_sim
from spark.demo.sample import sample_motion, sample_rig
from spark.errors import FileFormatError, SparkSimError
from spark.io.position_layouts import KNOWN, Layout, layouts
from spark.io.reading import read_motion
from spark.io.recording import Recording, read_recording
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import understand
from spark.rig.roles import Role
from spark.rotation import quat_angle, quat_rotate
from spark.transfer.canonical import to_canonical
from tests.helpers.hostile import damaged, edits
from tests.helpers.points import as_person, points_of
from tests.helpers.recordings import recordings
from tests.helpers.smpl import model_rig

TO_Y_UP = [1, 2, 0]
COUNTS = (17, 22, 24, 33, 52, 53, 55)


@pytest.fixture(scope="module")
def walking() -> Motion:
    return sample_motion("walk", sample_rig("walker"), 30.0)


def missed(read: Recording, layout: Layout, expected: np.ndarray) -> float:
    """The largest distance [m] of any point from where it should be."""
    positions, _ = forward(read.motion)
    places = [read.motion.skeleton.names.index(name) for name in layout.points]
    return float(np.linalg.norm(positions[:, places] - expected, axis=-1).max())


@pytest.mark.parametrize("count", COUNTS)
@pytest.mark.parametrize("motion", ["walk", "wave", "squat"])
def test_every_layout_is_met(tmp_path: Path, count: int, motion: str) -> None:
    person = as_person(sample_motion(motion, sample_rig("walker"), 30.0))
    layout = layouts(count)[0]
    points = points_of(layout, person)
    np.save(tmp_path / "a.npy", points[..., TO_Y_UP] * 100)
    read = read_motion(tmp_path / "a.npy", fps=30.0)
    assert (read.convention.unit, read.convention.up) == ("cm", "y")
    assert f"positions of {layout.name}'s {count} joints" in read.notes
    assert missed(read, layout, points) < 0.02 * 1.74
    # The same rotations as the body's that was seen, but for turns about bones.
    rig = understand(read.motion)
    own, true = to_canonical(read.motion, rig), to_canonical(person, model_rig(52, 1.74))
    for role in (Role.PELVIS, Role.LEFT_UPPER_LEG, Role.RIGHT_LOWER_LEG, Role.LEFT_UPPER_ARM):
        a = own.rotations[:, rig.roles.require(role)]
        b = true.rotations[:, true.rig.roles.require(role)]
        assert np.degrees(np.median(quat_angle(a, b))) < 25


@pytest.mark.parametrize("path", recordings("terrain/*/*.npy"))
def test_climbs_over_boxes(path: Path) -> None:
    points = np.load(path).astype(float)
    clip = spark_sim.load(path)
    assert clip.fps == pytest.approx(120)
    assert clip.recording.convention.up == "z"
    height = np.median(np.ptp(points, axis=1).max(axis=-1))
    assert missed(clip.recording, layouts(53)[0], points) < 0.02 * height
    assert clip.motion.translations is None  # bones of one length, so rotations alone do
    assert clip.rig.hip_height == pytest.approx(0.88, abs=0.02)
    np.testing.assert_allclose(clip.rig.tpose[:, 0], 1, atol=0.01)  # it rests in the T-pose
    # The legs bend where knees do: the shank never turns about the thigh by itself.
    assert np.abs(np.diff(clip.motion.rotations, axis=0)).max() < 0.3


@pytest.mark.parametrize("path", recordings("deepmimic/*.bvh", "cmu_asf/cmu_02_0*.bvh"))
def test_bodies_upside_down_and_on_the_floor(path: Path, tmp_path: Path) -> None:
    person = as_person(read_recording(path).motion)
    points = points_of(layouts(22)[0], person)
    np.save(tmp_path / "a.npy", points[..., TO_Y_UP])
    read = read_motion(tmp_path / "a.npy")
    assert read.convention.up == "y"
    assert missed(read, layouts(22)[0], points) < 0.02 * 1.74


def test_layouts_of_as_many_points_are_told_apart(walking: Motion, tmp_path: Path) -> None:
    person = as_person(walking)
    for layout in layouts(17):
        np.save(tmp_path / "a.npy", points_of(layout, person))
        read = read_motion(tmp_path / "a.npy", up="z")
        assert f"positions of {layout.name}'s 17 joints" in read.notes


@pytest.mark.parametrize("layout", layouts(17), ids=lambda layout: layout.name)
def test_feet_that_end_at_the_ankles_stand_on_soles(
    walking: Motion, tmp_path: Path, layout: Layout
) -> None:
    """Hips are as high as those of the person whose points these are, of whom feet are known."""
    person = as_person(walking)
    np.save(tmp_path / "a.npy", points_of(layout, person))
    rig = understand(read_motion(tmp_path / "a.npy", up="z").motion)
    assert rig.hip_height == pytest.approx(understand(person).hip_height, rel=0.03)
    assert any("below these" in note for note in rig.notes)


def test_names_in_any_order(walking: Motion, tmp_path: Path) -> None:
    layout = layouts(53)[0]
    points = points_of(layout, as_person(walking))
    order = np.random.default_rng(0).permutation(53)
    names = [layout.points[i].upper() for i in order]
    np.savez(tmp_path / "a.npz", positions=points[:, order], names=names, fps=60)
    read = read_motion(tmp_path / "a.npz")
    assert read.motion.fps == pytest.approx(60)
    assert missed(read, layout, points) < 0.02 * 1.74


@pytest.mark.parametrize("parents", [True, False])
def test_names_of_no_layout(walking: Motion, tmp_path: Path, parents: bool) -> None:
    """A skeleton of its own, with the parents in the file, or found by what stays in one piece."""
    motion = walking
    points, _ = forward(motion)
    arrays: dict[str, Any] = {"xyz": points, "joint_names": np.array(motion.skeleton.names)}
    if parents:
        arrays["parents"] = motion.skeleton.parents
    np.savez(tmp_path / "a.npz", **arrays)
    read = read_motion(tmp_path / "a.npz")
    found, _ = forward(read.motion)
    order = [read.motion.skeleton.names.index(name) for name in motion.skeleton.names]
    assert np.linalg.norm(found[:, order] - points, axis=-1).max() < 0.02 * 1.7
    rig = understand(read.motion)
    own = understand(motion)
    for role in (Role.PELVIS, Role.LEFT_UPPER_LEG, Role.RIGHT_HAND, Role.HEAD, Role.LEFT_TOE):
        name = read.motion.skeleton.names[rig.roles.require(role)]
        assert name == motion.skeleton.names[own.roles.require(role)]


def test_a_camera_s_landmarks(walking: Motion, tmp_path: Path) -> None:
    """MediaPipe's: y down, hips in the origin, a visibility for each, and gaps."""
    layout = layouts(33)[0]
    points = points_of(layout, as_person(walking))
    hips = points[:, [layout.points.index(f"{side}_hip") for side in ("left", "right")]].mean(
        axis=1
    )
    seen = (points - hips[:, None])[..., TO_Y_UP] * [1, -1, -1]
    seen = np.concatenate([seen, np.ones((*seen.shape[:2], 1))], axis=-1)
    seen[5, 3, :3] = np.nan
    np.save(tmp_path / "a.npy", seen)
    read = read_motion(tmp_path / "a.npy")
    said = " ".join(read.notes)
    for words in ("y axis points down", "its confidence", "1 positions are missing", "never move"):
        assert words in said
    found, _ = forward(read.motion)
    way = np.linalg.norm(hips[-1] - hips[0])
    assert np.linalg.norm(found[-1, 0] - found[0, 0]) == pytest.approx(way, rel=0.15)
    head = read.motion.skeleton.names.index("head")
    assert (found[:, head, 2] - found[:, 0, 2]).min() > 0.5


def test_bones_that_change_their_length_keep_their_places(walking: Motion, tmp_path: Path) -> None:
    layout = layouts(22)[0]
    points = points_of(layout, as_person(walking))
    points += np.random.default_rng(0).normal(0, 0.03, points.shape)
    np.save(tmp_path / "a.npy", points[..., TO_Y_UP])
    read = read_motion(tmp_path / "a.npy")
    assert missed(read, layout, points) < 0.02 * 1.74
    assert any("bones change their length" in note for note in read.notes)


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (np.zeros((5, 22)), "the array is 5 x 22; expected frames x joints x 3"),
        (np.zeros((5, 22, 2)), "expected frames x joints x 3"),
        (np.zeros((5, 20, 3)), f"20 joints without names; known are {KNOWN[:7]}"),
        (np.zeros((0, 22, 3)), "has no frames"),
        (np.full((5, 22, 3), np.nan), "joint 0 has no position in any frame"),
        (np.full((5, 22, 3), 1e300), "holds 1e.300"),
        (np.zeros((5, 22, 3)), "all joints lie in one point"),
    ],
)
def test_what_is_refused(tmp_path: Path, array: np.ndarray, message: str) -> None:
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(SparkSimError, match=rf"a\.npy: .*{message.replace('(', '.')}"):
        spark_sim.load(tmp_path / "a.npy")


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ({"names": ["a", "b"]}, "'names' has 2 names for 4 joints"),
        ({"names": list("abcd"), "parents": [-1, -1, 0, 0]}, "'parents' is no tree of 4 joints"),
        ({"names": list("abcd"), "parents": [-1, 2, 1, 0]}, "round in a circle"),
        ({"names": list("abcd"), "fps": -3}, "'fps' is -3"),
    ],
)
def test_names_and_trees_that_are_none(
    tmp_path: Path, arrays: dict[str, Any], message: str
) -> None:
    np.savez(tmp_path / "a.npz", positions=np.random.default_rng(0).random((3, 4, 3)), **arrays)
    with pytest.raises(SparkSimError, match=rf"a\.npz: .*{message}"):
        spark_sim.load(tmp_path / "a.npz")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("positions")


@given(
    changes=edits,
    frames=st.integers(1, 3),
    values=st.lists(st.floats(-1e12, 1e12) | st.sampled_from([0.0, np.nan]), min_size=4),
)
@settings(deadline=None, max_examples=100)
def test_damaged_files_give_a_recording_or_an_error_of_ours(
    folder: Path, changes: list[tuple[str, int, int]], frames: int, values: list[float]
) -> None:
    array = np.resize(np.array(values), (frames, 22, 3))
    np.save(folder / "whole.npy", array)
    (folder / "c.npy").write_bytes(damaged((folder / "whole.npy").read_bytes(), changes))
    for name in ("c.npy", "whole.npy"):
        try:
            read = read_motion(folder / name)
        except SparkSimError:
            continue
        assert np.isfinite(forward(read.motion)[0]).all()


def test_an_npz_without_positions(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", motion=np.zeros((4, 4)), other=np.zeros(3))
    with pytest.raises(FileFormatError, match=r"no positions: .* it holds motion 4x4, other 3"):
        spark_sim.load(tmp_path / "a.npz")


def features_of(positions: np.ndarray) -> np.ndarray:
    """HumanML3D's features of positions (T 22 3), Y up, in the steps of its `motion_process.py`."""
    left, right = positions[:, 1] - positions[:, 2], positions[:, 16] - positions[:, 17]
    ahead = np.cross(left + right, [0.0, 1.0, 0.0])
    angle = np.arctan2(ahead[:, 0], ahead[:, 2])  # from +Z about Y
    facing = np.zeros((len(positions), 4))
    facing[:, 0], facing[:, 2] = np.cos(-angle / 2), np.sin(-angle / 2)
    half = np.unwrap(-angle) / 2
    root = positions[:, 0]
    seen = positions - root[:, None] * [1.0, 0.0, 1.0]
    seen = quat_rotate(np.broadcast_to(facing[:, None], (*seen.shape[:2], 4)), seen)
    step = quat_rotate(facing[1:], np.diff(root, axis=0))
    features = np.zeros((len(positions) - 1, 263))
    features[:, 0], features[:, 1:3] = np.diff(half), step[:, [0, 2]]
    features[:, 3] = root[:-1, 1]
    features[:, 4:67] = seen[:-1, 1:].reshape(-1, 63)
    return features


def test_features_of_humanml3d(tmp_path: Path, walking: Motion) -> None:
    """Its positions, from the first frame's place and heading on."""
    (layout,) = layouts(22)
    expected = points_of(layout, as_person(walking))
    turn = np.zeros((*expected.shape[:2], 4))
    turn[..., 0], turn[..., 3] = np.cos(0.4), np.sin(0.4)
    features = features_of(quat_rotate(turn, expected)[..., TO_Y_UP])
    np.save(tmp_path / "a.npy", features)
    read = read_motion(tmp_path / "a.npy")
    assert read.motion.fps == pytest.approx(20)
    assert "HumanML3D" in " ".join(read.notes)
    positions, _ = forward(read.motion)
    places = [read.motion.skeleton.names.index(name) for name in layout.points]
    got = positions[:, places]

    def standard(points: np.ndarray) -> np.ndarray:
        """From above the first place of the hips, facing along X in the first frame."""
        points = points - points[0, 0] * [1, 1, 0]
        across = points[0, 1] - points[0, 2] + points[0, 16] - points[0, 17]
        back = -np.arctan2(-across[0], across[1]) / 2
        q = np.zeros((*points.shape[:2], 4))
        q[..., 0], q[..., 3] = np.cos(back), np.sin(back)
        return quat_rotate(q, points)

    away = np.linalg.norm(standard(got) - standard(expected[:-1]), axis=-1)
    assert away.max() < 0.02 * 1.74


def test_features_that_are_normalised_are_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.random.default_rng(0).normal(size=(40, 263)))
    with pytest.raises(FileFormatError, match=r"seem normalised.*Std\.npy"):
        read_motion(tmp_path / "a.npy")


def test_intermimic_s_states_are_read(walking: Motion, tmp_path: Path) -> None:
    """A tensor of frames x 591, in which a limb comes after the other: the joints are where they
    were. A tensor of another width is refused by name."""
    torch = pytest.importorskip("torch")
    person = as_person(walking)
    positions, _ = forward(person)
    named = dict(zip(person.skeleton.names, positions.transpose(1, 0, 2), strict=True))
    fingers = [f"{f}{k}" for f in ("index", "middle", "pinky", "ring", "thumb") for k in (1, 2, 3)]
    leg = ("hip", "knee", "ankle", "foot")
    arm = ("collar", "shoulder", "elbow", "wrist", *fingers)
    order = ["pelvis", *(f"{side}_{part}" for side in ("left", "right") for part in leg)]
    order += ["spine1", "spine2", "spine3", "neck", "head"]
    order += [f"{side}_{part}" for side in ("left", "right") for part in arm]
    states = np.random.default_rng(1).normal(size=(len(person), 591))
    states[:, 162:318] = np.concatenate([named[name] for name in order], axis=1)
    torch.save(torch.tensor(states, dtype=torch.float32), tmp_path / "sub1_box_001.pt")
    read = read_motion(tmp_path / "sub1_box_001.pt")
    found, _ = forward(read.motion)
    at = [person.skeleton.names.index(name) for name in read.motion.skeleton.names]
    size = np.ptp(positions[0], axis=0).max()
    off = np.linalg.norm(found - positions[:, at], axis=-1) / size
    assert off.max() < 0.011
    assert read.motion.fps == 30
    assert "InterMimic" in " ".join(read.notes)
    torch.save(torch.zeros(4, 590), tmp_path / "other.pt")
    with pytest.raises(FileFormatError, match="has no motion of a body"):
        read_motion(tmp_path / "other.pt")
