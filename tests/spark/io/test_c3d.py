"""C3D: points against what was written and against ezc3d, joints against the body that moved."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import spark_sim
from spark.errors import FileFormatError
from spark.io.c3d import read_c3d
from spark.io.c3d_file import read_c3d_points
from spark.kinematics import forward
from spark.rig.roles import Role
from spark.rotation import quat_rotate
from spark_sim import Clip
from tests.helpers.c3d import write_c3d

NAMES = {
    "pelvis": "PELO", "left_hip": "LHJC", "left_knee": "LKJC", "left_ankle": "LAJC",
    "left_foot": "LTOE", "right_hip": "RHJC", "right_knee": "RKJC", "right_ankle": "RAJC",
    "right_foot": "RTOE", "spine3": "TRXO", "neck": "Neck", "head": "HEDO",
    "left_shoulder": "LSJC", "left_elbow": "LEJC", "left_wrist": "LWJC",
    "right_shoulder": "RSJC", "right_elbow": "REJC", "right_wrist": "RWJC",
}  # fmt: skip
ROLES = {
    "pelvis": Role.PELVIS, "left_hip": Role.LEFT_UPPER_LEG, "left_knee": Role.LEFT_LOWER_LEG,
    "left_ankle": Role.LEFT_FOOT, "left_foot": Role.LEFT_TOE, "head": Role.HEAD,
    "right_hip": Role.RIGHT_UPPER_LEG, "right_knee": Role.RIGHT_LOWER_LEG,
    "right_ankle": Role.RIGHT_FOOT, "right_foot": Role.RIGHT_TOE, "neck": Role.NECK,
    "left_shoulder": Role.LEFT_UPPER_ARM, "left_elbow": Role.LEFT_FOREARM,
    "left_wrist": Role.LEFT_HAND, "right_shoulder": Role.RIGHT_UPPER_ARM,
    "right_elbow": Role.RIGHT_FOREARM, "right_wrist": Role.RIGHT_HAND,
}  # fmt: skip


def joints_of(clip: Clip) -> dict[str, np.ndarray]:
    """The places [m] of the joints that C3Ds have, by SMPL's names."""
    positions, _ = forward(clip.motion)
    roles = clip.rig.roles
    found = {name: positions[:, roles.require(role)] for name, role in ROLES.items()}
    return found | {"spine3": positions[:, clip.rig.chest]}


def centres(clip: Clip, path: Path, **how: object) -> Path:
    """The clip's joints as joint centres in mm, Z up."""
    places = joints_of(clip)
    labels = [f"subject:{NAMES[name]}" for name in places]
    points = 1000 * np.stack(list(places.values()), axis=1)
    return write_c3d(path, labels, points, rate=clip.fps, **how)


@pytest.mark.parametrize("processor", ["intel", "dec", "sgi"])
@pytest.mark.parametrize("integers", [False, True])
@pytest.mark.parametrize("analogue", [0, 6])
def test_points_are_read_as_they_were_written(
    processor: str, integers: bool, analogue: int, tmp_path: Path
) -> None:
    rng = np.random.default_rng(0)
    points = np.round(rng.uniform(-2000, 2000, (7, 4, 3)), 1)
    points[2, 1] = np.nan
    path = write_c3d(
        tmp_path / "a.c3d", ["A", "B:one", "long name", "D"], points, rate=59.94,
        processor=processor, integers=integers, analogue=analogue,
    )  # fmt: skip
    read = read_c3d_points(path)
    assert read.labels == ("A", "B:one", "long name", "D")
    assert read.rate == pytest.approx(59.94)
    assert read.unit == "mm"
    np.testing.assert_allclose(read.values, points, atol=0.01)


@pytest.mark.parametrize("processor", ["intel", "dec"])  # ezc3d reads no SGI
def test_ezc3d_reads_the_same(processor: str, tmp_path: Path) -> None:
    """An independent reader."""
    ezc3d = pytest.importorskip("ezc3d")
    rng = np.random.default_rng(1)
    points = rng.uniform(-2000, 2000, (9, 3, 3))
    points[4, 2] = np.nan
    path = write_c3d(tmp_path / "a.c3d", ["A", "B", "C"], points, processor=processor)
    theirs = ezc3d.c3d(str(path))
    ours = read_c3d_points(path)
    assert tuple(theirs["parameters"]["POINT"]["LABELS"]["value"]) == ours.labels
    np.testing.assert_allclose(
        theirs["data"]["points"][:3].transpose(2, 1, 0), ours.values, rtol=1e-6
    )


def test_what_ezc3d_writes_is_read(tmp_path: Path) -> None:
    ezc3d = pytest.importorskip("ezc3d")
    rng = np.random.default_rng(2)
    points = rng.uniform(-2, 2, (300, 20, 3))
    file = ezc3d.c3d()
    labels = [f"P{k}" for k in range(20)]
    file["parameters"]["POINT"]["RATE"]["value"] = [120.0]
    file["parameters"]["POINT"]["LABELS"]["value"] = labels
    file["parameters"]["POINT"]["UNITS"]["value"] = ["m"]
    file["data"]["points"] = np.concatenate(
        [points.transpose(2, 1, 0), np.ones((1, 20, 300))], axis=0
    )
    file.write(str(tmp_path / "a.c3d"))
    read = read_c3d_points(tmp_path / "a.c3d")
    assert (list(read.labels), read.rate, read.unit) == (labels, 120.0, "m")
    np.testing.assert_allclose(read.values, points, atol=1e-6)


@pytest.mark.parametrize("up", ["z", "y"])
def test_joint_centres_become_joints(up: str, walk: Clip, tmp_path: Path) -> None:
    """Each within 2 % of the body's height, in the file's own unit and rate, whatever is up."""
    places = joints_of(walk)
    points = 1000 * np.stack(list(places.values()), axis=1)
    if up == "y":
        points = points[..., [1, 2, 0]]
    path = write_c3d(tmp_path / "a.c3d", [NAMES[n] for n in places], points, rate=walk.fps)
    clip = spark_sim.load(path)
    assert isinstance(clip, Clip)
    assert clip.recording.convention.up == up
    assert clip.fps == pytest.approx(walk.fps)
    got = joints_of(clip)
    height = 1.7
    for name, there in places.items():
        assert np.linalg.norm(got[name] - there, axis=-1).max() < 0.02 * height, name
    told = " ".join(clip.recording.notes)
    assert "18 joint centres" in told
    assert "unit 0.1 cm, as the file says" in told


def test_other_words_for_joints(walk: Clip, tmp_path: Path) -> None:
    """Visual3D's, Motive's and Xsens' words."""
    places = joints_of(walk)
    points = 1000 * np.stack(list(places.values()), axis=1)
    for words in (
        "Hips LeftUpLeg LeftLeg LeftFoot LeftToeBase Head RightUpLeg RightLeg RightFoot "
        "RightToeBase Neck LeftArm LeftForeArm LeftHand RightArm RightForeArm RightHand Spine2",
        "Hip LThigh LShin LFoot LToe Head RThigh RShin RFoot RToe Neck LUArm LFArm LHand RUArm "
        "RFArm RHand Chest",
        "Pelvis LEFT_HIP LEFT_KNEE LEFT_ANKLE LEFT_TOE HEAD RIGHT_HIP RIGHT_KNEE RIGHT_ANKLE "
        "RIGHT_TOE NECK LEFT_SHOULDER LEFT_ELBOW LEFT_WRIST RIGHT_SHOULDER RIGHT_ELBOW "
        "RIGHT_WRIST THORAX",
    ):
        order = [*ROLES, "spine3"]
        path = write_c3d(
            tmp_path / "a.c3d", words.split(), points[:, [list(places).index(n) for n in order]]
        )
        assert "18 joint centres" in read_c3d(path).notes[0]


def markers(clip: Clip) -> dict[str, np.ndarray]:
    """Plug-in Gait's markers on the clip's body [m], placed in the axes of its own joints."""
    positions, world = forward(clip.motion)
    roles, tpose = clip.rig.roles, clip.rig.tpose
    from spark.rotation import quat_conj, quat_mul

    since = quat_mul(world, quat_conj(tpose))  # rotations since the T-pose, in world axes

    def on(role: Role, x: float, y: float, z: float) -> np.ndarray:
        j = roles.require(role)
        offset = np.broadcast_to(np.array([x, y, z], float), positions[:, j].shape)
        return positions[:, j] + quat_rotate(since[:, j], offset)

    found = {}
    j = roles.require(Role.PELVIS)
    uppers = [roles.require(Role(f"{side}_upper_leg")) for side in ("left", "right")]
    hips = positions[:, uppers].swapaxes(0, 1)
    middle, half = hips.mean(axis=0), 0.5 * np.linalg.norm(hips[0] - hips[1], axis=-1).mean()
    width = (half - 0.0073) / 0.33  # Harrington's regression, the other way round
    depth = 0.15
    back = np.array([0.24 * depth + 0.0099, 0, 0.30 * width + 0.0109])
    for side, s, y in (("left", "L", 1.0), ("right", "R", -1.0)):
        for name, x in (("ASI", 0.0), ("PSI", -depth)):
            at = back + np.array([x, y * width / (2 if name == "ASI" else 6), 0])
            found[s + name] = middle + quat_rotate(since[:, j], np.broadcast_to(at, middle.shape))
        found[s + "KNE"] = on(Role(f"{side}_lower_leg"), 0, 0.061 * y, 0)
        found[s + "ANK"] = on(Role(f"{side}_foot"), 0, 0.045 * y, 0)
        found[s + "TOE"] = on(Role(f"{side}_toe"), 0, 0, 0)
        found[s + "SHO"] = on(Role(f"{side}_upper_arm"), 0, 0, 0)
        found[s + "SHO"][:, 2] += 0.06
        found[s + "ELB"] = on(Role(f"{side}_forearm"), 0, 0, 0)
        found[s + "WRA"] = on(Role(f"{side}_hand"), 0.03, 0, 0)
        found[s + "WRB"] = on(Role(f"{side}_hand"), -0.03, 0, 0)
        for name, x in (("FHD", 0.1), ("BHD", -0.1)):
            found[s + name] = on(Role.HEAD, x, 0.07 * y, 0.1)
    for name, x in (("T10", -0.1), ("STRN", 0.1)):
        found[name] = on(Role.SPINE, x, 0, 0.2)
    for name, x in (("C7", -0.06), ("CLAV", 0.06)):
        found[name] = on(Role.NECK, x, 0, 0)
    return found


def test_markers_of_plug_in_gait_become_joints(walk: Clip, tmp_path: Path) -> None:
    """Hips within a centimetre, knees and ankles within two, as the note says."""
    found = markers(walk)
    points = 1000 * np.stack(list(found.values()), axis=1)
    clip = spark_sim.load(write_c3d(tmp_path / "a.c3d", list(found), points, rate=walk.fps))
    assert isinstance(clip, Clip)
    assert "estimated from markers" in clip.recording.notes[0]
    ours, theirs = joints_of(walk), joints_of(clip)
    for name, limit in (("hip", 0.01), ("knee", 0.02), ("ankle", 0.02), ("shoulder", 0.03)):
        for side in ("left", "right"):
            away = np.linalg.norm(ours[f"{side}_{name}"] - theirs[f"{side}_{name}"], axis=-1)
            assert away.max() < limit, (side, name, away.max())


def test_gaps_are_filled_in_and_told(walk: Clip, tmp_path: Path) -> None:
    places = joints_of(walk)
    points = 1000 * np.stack(list(places.values()), axis=1)
    whole = points.copy()
    knee = list(places).index("left_knee")
    points[10:13, knee] = np.nan
    path = write_c3d(tmp_path / "a.c3d", [NAMES[n] for n in places], points, rate=walk.fps)
    recording = read_c3d(path)
    (told,) = (note for note in recording.notes if "missing" in note)
    assert told.startswith("3 positions are missing, 0.1 s at the longest")
    clip = spark_sim.load(path)
    assert isinstance(clip, Clip)
    away = np.linalg.norm(joints_of(clip)["left_knee"] - whole[:, knee] / 1000, axis=-1)
    assert away.max() < 0.04


def test_points_of_something_else_are_refused_with_what_to_do(tmp_path: Path) -> None:
    points = np.random.default_rng(0).normal(size=(5, 3, 3))
    path = write_c3d(tmp_path / "a.c3d", ["Wand1", "Wand2", "Wand3"], points)
    with pytest.raises(FileFormatError, match=r"3 points \('Wand1'.*LHJC.*Plug-in Gait"):
        read_c3d(path)
    path.write_bytes(path.read_bytes()[:512])
    with pytest.raises(FileFormatError, match="no C3D file that can be read"):
        read_c3d(path)
    path.write_bytes(b"HIERARCHY")
    with pytest.raises(FileFormatError, match="no C3D file that can be read"):
        read_c3d(path)


@settings(max_examples=200, deadline=None)
@given(at=st.integers(0, 1600), put=st.binary(max_size=4), cut=st.integers(0, 6))
def test_spoilt_bytes_end_in_an_error_or_in_numbers(
    at: int, put: bytes, cut: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.getbasetemp() / "spoilt.c3d"
    if not (seed := path.with_name("seed.c3d")).exists():
        points = np.random.default_rng(0).normal(size=(6, len(NAMES), 3))
        write_c3d(seed, list(NAMES.values()), 1000 * points)
    data = seed.read_bytes()
    path.write_bytes(data[:at] + put + data[at + cut :])
    try:
        read = read_c3d_points(path)
    except FileFormatError:
        return
    assert len(read.labels) == read.values.shape[1]
    assert read.values.size <= len(data)
