"""From file numbers to SI motion: against an evaluation of BVH written out by hand."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spark.errors import FileFormatError
from spark.io.bvh import Bvh, read_bvh
from spark.io.bvh_hierarchy import CHANNELS, BvhJoint
from spark.io.convention import UNITS
from spark.io.encoding import encode
from spark.io.recording import Recording, read_recording
from spark.kinematics import end_positions, forward
from spark.motion import LazyMotion
from tests.helpers.bvh_by_hand import XYZ, ZXY, assert_as_by_hand, human, save
from tests.helpers.recordings import recording, recordings


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


def test_an_odd_frame_time_is_pointed_out(tmp_path: Path) -> None:
    bvh = human()
    found = read_recording(save(Bvh(bvh.joints, 0.9, bvh.values), tmp_path))
    assert "a frame lasts 0.9 s" in found.notes[0]


@pytest.mark.parametrize(
    ("frame_time", "meant"), [(33.333, "0.033333"), (30.0, "0.0333333"), (3600.0, ""), (33e-6, "")]
)
def test_a_frame_time_in_another_unit_is_refused(
    tmp_path: Path, frame_time: float, meant: str
) -> None:
    """In milliseconds, a minute would be read as sixteen hours."""
    bvh = human()
    path = save(Bvh(bvh.joints, frame_time, bvh.values), tmp_path)
    with pytest.raises(
        FileFormatError, match=r"bvh: Frame Time is .* s; expected 0.0001 to 1 s"
    ) as e:
        read_recording(path)
    assert (f"write {meant}" in str(e.value)) == bool(meant)


def test_long_recordings_are_decoded_as_they_are_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In blocks, in part or as a whole: the same numbers."""
    bvh, rng = human(), np.random.default_rng(0)
    values = np.repeat(bvh.values[:1], 100, axis=0)
    values += rng.normal(0, 3, values.shape)
    path = save(Bvh(bvh.joints, 0.04, values), tmp_path)
    whole = read_recording(path).motion
    monkeypatch.setattr("spark.io.recording.BLOCK", 16)
    monkeypatch.setattr("spark.io.bvh_rows._BLOCK", 1000)
    found = read_recording(path)
    lazy = found.motion
    assert isinstance(lazy, LazyMotion)
    assert not isinstance(whole, LazyMotion)
    np.testing.assert_array_equal(found.bvh.values, values)
    assert (len(lazy), lazy.fps, lazy.skeleton.names) == (100, 25, whole.skeleton.names)
    np.testing.assert_array_equal(lazy.root_pos, whole.root_pos)
    some, same = lazy.frames(30, 60), whole.frames(30, 60)
    np.testing.assert_array_equal(some.rotations, same.rotations)
    np.testing.assert_array_equal(lazy.thinned(30).rotations, whole.rotations[::4])
    np.testing.assert_array_equal(replace(lazy, frame_time=0.5).rotations, whole.rotations)
    np.testing.assert_array_equal(lazy.rotations, whole.rotations)
    if whole.translations is not None:
        np.testing.assert_array_equal(lazy.translations, whole.translations)


@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("block", [1, 100, 1 << 20])
def test_rows_are_read_in_blocks_as_in_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, line_end: str, block: int
) -> None:
    bvh, rng = human(), np.random.default_rng(1)
    values = rng.normal(0, 100, (20, bvh.values.shape[1]))
    path = save(Bvh(bvh.joints, 0.04, values), tmp_path)
    monkeypatch.setattr("spark.io.bvh_rows._BLOCK", block)
    path.write_bytes(path.read_bytes().replace(b"\n", line_end.encode()))
    np.testing.assert_array_equal(read_bvh(path).values, values)
    text = path.read_bytes()
    path.write_bytes(text[:-200] + text[-200:].replace(b".", b"x", 1))
    with pytest.raises(FileFormatError, match="expected a finite number"):
        read_bvh(path)
    # A value moved from one row to another is no wrapped row.
    lines = text.decode().split(line_end)
    first, rest = lines[-3].rsplit(" ", 1)
    lines[-3], lines[-2] = first, f"{rest} {lines[-2]}"
    path.write_bytes(line_end.join(lines).encode())
    with pytest.raises(FileFormatError, match="values in this row"):
        read_bvh(path)


def test_angles_that_may_be_radians_are_pointed_out(tmp_path: Path) -> None:
    """Of a body that moves; one that stands still has none to tell."""
    turns = np.linspace([0, 0, 0], [60.0, 30.0, 170.0], 9)
    for angles, doubted in ((turns, False), (np.radians(turns), True), (0 * turns, False)):
        notes = read_recording(save(human(turns=angles), tmp_path)).notes
        assert any("radians" in note for note in notes) is doubted
