"""ASF and AMC: answers worked by hand, and CMU's bodies and motions written in the format."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import spark_sim
from spark.errors import FileFormatError, SparkSimError
from spark.io.acclaim import read_acclaim
from spark.io.reading import motion_files, read_motion
from spark.kinematics import end_positions, forward
from spark.motion import Motion
from tests.helpers.acclaim import AMC, ASF
from tests.helpers.hostile import damaged, edits
from tests.helpers.recordings import recordings


def write(folder: Path, asf: str = ASF, amc: str = AMC) -> Path:
    (folder / "a.asf").write_text(asf)
    (folder / "a.amc").write_text(amc)
    return folder / "a.amc"


def test_by_hand(tmp_path: Path) -> None:
    read = read_acclaim(write(tmp_path), up="z", unit="m")
    motion = read.motion
    assert motion.skeleton.names == ("root", "thigh", "knee", "stiff")
    assert motion.fps == pytest.approx(120)
    positions, world = forward(motion)
    np.testing.assert_allclose(
        positions[0], [[1, 2, 3], [1, 2, 3], [11, 2, 3], [11, -3, 3]], atol=1e-12
    )
    # The thigh's own x axis is the world's y; the knee's, which the thigh carries along, its x.
    turn = Rotation.from_euler("y", 90, degrees=True)
    knee = turn.apply([10, 0, 0])
    np.testing.assert_allclose(positions[1, 2] - positions[1, 1], knee, atol=1e-12)
    shank = (turn * Rotation.from_euler("x", 90, degrees=True)).apply([0, -5, 0])
    np.testing.assert_allclose(positions[1, 3] - positions[1, 2], shank, atol=1e-12)
    tip = end_positions(motion.skeleton, positions, world)
    np.testing.assert_allclose(tip[0, 0], [11, -3, 5], atol=1e-12)


def test_what_is_said(tmp_path: Path) -> None:
    read = read_acclaim(write(tmp_path), up="y")
    assert read.convention.unit == "cmu"
    notes = " ".join(read.notes)
    for words in ("unit 5.644 cm, as the file says", "skeleton of a.asf", "120 fps, as CMU's"):
        assert words in notes
    assert read_acclaim(tmp_path / "a.amc", fps=60.0).motion.fps == pytest.approx(60)
    rest = read_acclaim(tmp_path / "a.asf")
    assert len(rest.motion) == 1
    assert any("rest pose" in note for note in rest.notes)


def test_angles_in_radians_and_other_orders(tmp_path: Path) -> None:
    asf = ASF.replace("angle deg", "angle rad").replace("axis 0 0 90 XYZ", "axis 0.3 0.2 0.1 ZYX")
    asf = asf.replace("dof rx ry rz", "dof rz rx ry")
    amc = AMC.replace(":DEGREES\n", "").replace("thigh 90 0 0", "thigh 0.5 -0.4 0.3")
    motion = read_acclaim(write(tmp_path, asf, amc), up="z").motion
    axis = Rotation.from_euler("zyx", [0.1, 0.2, 0.3])
    own = Rotation.from_euler("zxy", [0.5, -0.4, 0.3])
    expected = (axis * own * axis.inv()).as_quat(canonical=True)
    found = motion.rotations[1, 1, [1, 2, 3, 0]]
    np.testing.assert_allclose(found * np.sign(found[3]), expected, atol=1e-9)


def as_acclaim(motion: Motion, folder: Path, unit: float) -> Path:
    """A motion of which every joint that has one child lies on a bone: bones end where their
    joint's only child is, and joints with several get bones in between, as CMU's bodies have."""
    skeleton = motion.skeleton
    rng = np.random.default_rng(0)

    def to_file(vector: np.ndarray) -> np.ndarray:
        return vector[..., [1, 2, 0]] / unit  # y up

    names = skeleton.names
    rows = [f"root {' '.join(map(str, to_file(p)))} 0 0 0" for p in motion.root_pos]
    bones: list[tuple[str, np.ndarray, np.ndarray | None]] = []
    links, values = [], []
    for j in range(len(skeleton)):
        parent = int(skeleton.parents[j])
        children = skeleton.children[j]
        if len(children) > 1 or j == 0:
            tip = np.zeros(3)
        elif children:
            tip = to_file(skeleton.offsets[children[0]])
        else:
            ends = skeleton.end_offsets[skeleton.end_parents == j]
            tip = to_file(ends[0]) if len(ends) else np.zeros(3)
        if parent >= 0 and (len(skeleton.children[parent]) > 1 or parent == 0):
            bones.append((f"to_{names[j]}", to_file(skeleton.offsets[j]), None))
            links.append((f"{names[parent]}_", f"to_{names[j]}"))
            above = f"to_{names[j]}"
        else:
            above = "" if parent < 0 else names[parent] + "_"
        axis = rng.uniform(-90, 90, 3)
        bones.append((names[j] + "_", tip, axis))
        links.append((above or "root", names[j] + "_"))
        turn = Rotation.from_quat(motion.rotations[:, j][:, [2, 3, 1, 0]])
        frame = Rotation.from_euler("xyz", axis, degrees=True)
        values.append((frame.inv() * turn * frame).as_euler("xyz", degrees=True))
    lines = [":units", "length 0.45", "angle deg", ":root", "order TX TY TZ RX RY RZ", "axis XYZ"]
    lines += ["position 0 0 0", "orientation 0 0 0", ":bonedata"]
    for name, tip, euler in bones:
        length = float(np.linalg.norm(tip))
        way = tip / length if length else tip
        lines += ["begin", f"name {name}", f"direction {way[0]} {way[1]} {way[2]}"]
        lines += [f"length {length}"]
        if euler is None:
            lines += ["axis 0 0 0 XYZ"]
        else:
            lines += [f"axis {euler[0]} {euler[1]} {euler[2]} XYZ", "dof rx ry rz"]
        lines += ["end"]
    lines += [":hierarchy", "begin", *(f"{a} {b}" for a, b in links), "end"]
    (folder / "07.asf").write_text("\n".join(lines))
    turning = [name for name, _, axis in bones if axis is not None]
    amc = [":FULLY-SPECIFIED", ":DEGREES"]
    for t in range(len(motion)):
        amc += [str(t + 1), rows[t]]
        amc += [f"{n} {v[t][0]} {v[t][1]} {v[t][2]}" for n, v in zip(turning, values, strict=True)]
    (folder / "07_03.amc").write_text("\n".join(amc))
    return folder / "07_03.amc"


@pytest.mark.parametrize("path", recordings("cmu_asf/cmu_0[13]_0[1-3].bvh"))
def test_cmu_s_bodies(path: Path, tmp_path: Path) -> None:
    """CMU's own bones and motions, with axes turned at random: the same places come out."""
    source = read_motion(path).motion.frames(0, 30)
    read = read_motion(as_acclaim(source, tmp_path, 0.0254 / 0.45))
    names = [f"{name}_" for name in source.skeleton.names]
    order = [read.motion.skeleton.names.index(name) for name in names]
    np.testing.assert_allclose(forward(read.motion)[0][:, order], forward(source)[0], atol=1e-6)
    assert spark_sim.load(tmp_path / "07_03.amc").rig.hip_height > 0.7


def test_the_skeleton_beside(tmp_path: Path) -> None:
    path = write(tmp_path)
    path.rename(tmp_path / "01_02.amc")
    assert len(read_motion(tmp_path / "01_02.amc").motion) == 2  # the only one
    (tmp_path / "b.asf").write_text("nothing")
    with pytest.raises(
        FileFormatError, match=r"01_02\.asf beside it \(there: 'a\.asf', 'b\.asf'\)"
    ):
        read_motion(tmp_path / "01_02.amc")
    (tmp_path / "01.ASF").write_text(ASF)
    assert len(read_motion(tmp_path / "01_02.amc").motion) == 2
    assert [p.name for p in motion_files(tmp_path)] == ["01_02.amc"]


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("knee stiff", "knee foot", 46, "'foot' is none of the bones"),
        ("thigh knee", "thigh stiff", 46, "'stiff' hangs on two bones"),
        ("    thigh knee\n", "", 46, "'knee' does not hang on the root"),
        ("name knee", "name thigh", 35, "'thigh' has no name, or that of another"),
        ("dof rx ry rz", "dof rx rq", 21, "expected different ones of tx"),
        ("axis 0 0 90 XYZ", "axis 0 0 90 XXZ", 20, "an order of axes such as XYZ"),
        ("direction 1 0 0", "direction 1 0", 18, "expected 3 numbers"),
        ("length 10", "length nan", 19, "expected 1 numbers"),
    ],
)
def test_broken_skeletons(tmp_path: Path, old: str, new: str, line: int, message: str) -> None:
    assert old in ASF
    with pytest.raises(FileFormatError, match=message) as caught:
        read_acclaim(write(tmp_path, ASF.replace(old, new)))
    assert caught.value.path == tmp_path / "a.asf"
    assert caught.value.line in (line, line - 1, line + 1)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("knee 90\n", "", "the last frame has 2 of 3 bones: the file is cut short"),
        ("knee 0\n", "", "the frame before has 2 of 3 bones"),
        ("knee 90", "knee 90 1", "2 values for 'knee'; expected 1"),
        ("knee 90", "foot 90", "bone 'foot' is not in the skeleton"),
        ("knee 90", "knee x", "expected 1 numbers after 'knee'"),
        (AMC, ":DEGREES\n", "holds no frames"),
    ],
)
def test_broken_motions(tmp_path: Path, old: str, new: str, message: str) -> None:
    with pytest.raises(FileFormatError, match=message):
        read_acclaim(write(tmp_path, amc=AMC.replace(old, new)))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("acclaim")


@given(changes=edits, which=st.booleans())
@settings(deadline=None, max_examples=200)
def test_damaged_files_give_a_recording_or_an_error_of_ours(
    folder: Path, changes: list[tuple[str, int, int]], which: bool
) -> None:
    path = write(folder)
    spoilt = path if which else folder / "a.asf"
    spoilt.write_bytes(damaged(spoilt.read_bytes(), changes))
    try:
        read = read_motion(path)
    except SparkSimError:
        return
    assert np.isfinite(forward(read.motion)[0]).all()
