"""The SMPL family: every layout gives the motion that it was made from, upright, on known bones."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings

import spark_sim
from spark.demo.sample import sample_motion, sample_rig
from spark.errors import ConventionError, FileFormatError, SparkSimError
from spark.io.reading import motion_files, read_motion
from spark.io.recording import Recording, read_recording
from spark.io.smpl_body import joints_of, mean_body, read_body_model
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import understand
from spark.rotation import matrix_from_quat, quat_from_rotvec
from tests.helpers.hostile import Bomb, damaged, edits
from tests.helpers.recordings import recordings
from tests.helpers.smpl import LAYOUTS, TALL, in_layout, made


@pytest.fixture(scope="module")
def waving() -> Motion:
    return sample_motion("wave", sample_rig("walker"), 30.0)


def joints(recording: Recording) -> np.ndarray:
    return forward(recording.motion)[0]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_gives_the_motion_back(waving: Motion, tmp_path: Path, layout: str) -> None:
    up, count = LAYOUTS[layout]
    rotvecs, trans, expected = made(waving, up=up)
    content = in_layout(layout, rotvecs, trans)
    path = tmp_path / ("a.npz" if isinstance(content, dict) else "a.npy")
    if isinstance(content, dict):
        np.savez(path, **content)
    else:
        np.save(path, content)
    read = read_motion(path)
    assert read.convention.up == up
    assert read.motion.skeleton.names == joints_of(count)[0]
    assert read.motion.fps == pytest.approx(30)
    found = joints(read)[:, :22]
    # The model's origin hangs above the pelvis by what differs between the models.
    shift = (found - expected[:, :22]).reshape(-1, 3)
    assert np.ptp(shift, axis=0).max() < 1e-9
    assert np.abs(shift).max() < 0.13
    rig = understand(read.motion)
    np.testing.assert_allclose(rig.tpose[:16, 0], 1, atol=0.01)  # the rest pose is the T-pose
    assert rig.hip_height == pytest.approx(0.51 * TALL, rel=0.02)


def test_gvhmr(waving: Motion, tmp_path: Path) -> None:
    torch = pytest.importorskip("torch")
    rotvecs, trans, expected = made(waving, up="y", count=22)
    flat = torch.tensor(rotvecs.reshape(len(rotvecs), -1), dtype=torch.float32)
    world = {
        "body_pose": flat[:, 3:],
        "betas": torch.zeros(1, 10).expand(len(flat), 10),
        "global_orient": flat[:, :3],
        "transl": torch.tensor(trans, dtype=torch.float32),
    }
    camera = world | {"global_orient": torch.zeros(len(flat), 3)}
    result = {"smpl_params_incam": camera, "smpl_params_global": world}
    result |= {"K_fullimg": torch.eye(3), "net_outputs": {"model": Bomb(tmp_path / "ran")}}
    torch.save(result, tmp_path / "hmr4d_results.pt")
    clip = spark_sim.load(tmp_path / "hmr4d_results.pt")
    shift = forward(clip.motion)[0] - expected
    assert np.ptp(shift.reshape(-1, 3), axis=0).max() < 1e-5
    assert clip.notes[0] == "GVHMR, without fingers"
    assert any("30 fps" in note for note in clip.notes)
    assert not (tmp_path / "ran").exists()


def test_what_the_file_leaves_open_is_said(waving: Motion, tmp_path: Path) -> None:
    rotvecs, trans, _ = made(waving)
    bomb = np.array([Bomb(tmp_path / "ran")], dtype=object)
    poses = rotvecs.reshape(len(rotvecs), -1)
    np.savez(tmp_path / "a.npz", poses=poses, trans=trans, labels=bomb, gender="female")
    read = read_motion(tmp_path / "a.npz", fps=60.0, up="z")
    notes = " ".join(read.notes)
    assert "Python objects are not read: 'labels'" in notes
    assert "1.64 m tall (the mean of its gender, female)" in notes
    assert "up axis z, as given" in notes
    assert "fps" not in notes
    assert read.motion.fps == 60
    assert not (tmp_path / "ran").exists()
    assert "30 fps, as is usual" in " ".join(read_motion(tmp_path / "a.npz").notes)


@pytest.mark.parametrize(("up", "said"), [("y", "y"), ("z", "z"), ("-y", "y")])
def test_the_axis_along_which_the_body_stands(
    waving: Motion, tmp_path: Path, up: str, said: str
) -> None:
    """A file of a kind that has y up, with z up, or y down as cameras have it."""
    rotvecs, trans, expected = made(waving, up=up[-1])
    if up == "-y":
        from scipy.spatial.transform import Rotation

        over = Rotation.from_rotvec([np.pi, 0, 0])
        rotvecs[:, 0] = (over * Rotation.from_rotvec(rotvecs[:, 0])).as_rotvec()
        trans = trans * [1, -1, -1]
    np.save(tmp_path / "a.npy", in_layout("PHUMA", rotvecs, trans))
    read = read_motion(tmp_path / "a.npy")
    assert read.convention.up == said
    found = joints(read)
    np.testing.assert_allclose(
        found - found[:, :1], expected[:, :22] - expected[:, :1], atol=1e-9
    )  # the same heights and the same way round
    assert any("turned over" in note for note in read.notes) == (up == "-y")


@pytest.mark.parametrize("path", recordings("deepmimic/deepmimic_*.bvh"))
def test_bodies_that_crawl_and_tumble_keep_their_up_axis(path: Path, tmp_path: Path) -> None:
    rotvecs, trans, _ = made(read_recording(path).motion)
    np.savez(tmp_path / "a.npz", **in_layout("AMASS, SMPL-H", rotvecs, trans))
    assert read_motion(tmp_path / "a.npz").convention.up == "z"


@pytest.mark.parametrize("path", recordings("cmu_asf/cmu_02_0[16].bvh", "cmu_asf/cmu_03_*.bvh"))
def test_planted_feet_tell_the_height(path: Path, tmp_path: Path) -> None:
    """People of 1.60 and 1.85 m, in files that say nothing of it."""
    for height in (1.60, 1.85):
        rotvecs, trans, _ = made(read_recording(path).motion, height=height)
        layout = in_layout("AMASS, SMPL-H", rotvecs, trans) | {"mocap_framerate": 60}
        np.savez(tmp_path / "a.npz", **layout)
        (note,) = [note for note in read_motion(tmp_path / "a.npz").notes if "m tall" in note]
        if "planted" in note:
            assert float(note.split(",")[1].split()[0]) == pytest.approx(height, rel=0.07)


def test_rotations_alone_walk_on_their_feet(tmp_path: Path) -> None:
    """165 numbers a frame have no positions: the lower foot stands, and the body gets on."""
    rig = sample_rig("walker")
    walk = sample_motion("walk", rig, 30.0)
    rotvecs, _, expected = made(walk, count=55, up="y")
    for order in ([*range(55)], [*range(22), *range(25, 55), 22, 23, 24]):
        rotvecs[:, 22] = [0.2, 0, 0]  # the mouth is open
        np.save(tmp_path / "a.npy", rotvecs[:, order].reshape(len(rotvecs), -1))
        read = read_motion(tmp_path / "a.npy")
        found = joints(read)
        way = np.linalg.norm(expected[-1, 0] - expected[0, 0])
        assert np.linalg.norm(found[-1, 0] - found[0, 0]) == pytest.approx(way, rel=0.1)
        np.testing.assert_allclose(
            read.motion.rotations[:, 25:], [[1, 0, 0, 0]] * 30 * np.ones((len(rotvecs), 1, 1)),
            atol=0.2,
        )  # fmt: skip
        np.testing.assert_allclose(
            np.degrees(2 * np.arccos(read.motion.rotations[0, 22, 0])), 11.5, 0.1
        )


def test_folders_give_the_motions_among_other_arrays(waving: Motion, tmp_path: Path) -> None:
    rotvecs, trans, _ = made(waving)
    np.savez(tmp_path / "a.npz", **in_layout("AMASS, SMPL-H", rotvecs, trans))
    np.save(tmp_path / "b.npy", in_layout("PHUMA", rotvecs, trans))
    np.save(tmp_path / "weights.npy", np.zeros((4, 4)))
    np.savez(tmp_path / "robot.npz", qpos=np.zeros((2, 36)))
    (tmp_path / "c.npy").write_text("no array")
    (tmp_path / "c.pt").write_text("no tensors")
    assert [path.name for path in motion_files(tmp_path)] == ["a.npz", "b.npy"]


# The user's own body model


def write_model(path: Path, count: int, **changes: Any) -> dict[str, np.ndarray]:
    """A file like SMPL-X's: 400 vertices, joints as weighted means of them."""
    rng = np.random.default_rng(0)
    _, parents = joints_of(count)
    at = mean_body(count, 1.8).skeleton.rest_positions + rng.normal(0, 0.01, (count, 3))
    vertices = np.concatenate([at, rng.normal(0, 0.3, (400 - count, 3))])
    weights = np.zeros((count, 400))
    weights[np.arange(count), np.arange(count)] = 0.9
    weights[:, -1] = 0.1
    arrays: dict[str, Any] = {
        "v_template": vertices,
        "J_regressor": weights,
        "shapedirs": rng.normal(0, 0.01, (400, 3, 20)),
        "kintree_table": np.array([[2**32 - 1, *parents[1:]], range(count)], dtype=np.uint32),
        "joint2num": np.array({"Pelvis": 0}, dtype=object),
    }
    arrays |= changes
    np.savez(path, **{name: value for name, value in arrays.items() if value is not None})
    return arrays


def test_offsets_of_a_body_model(waving: Motion, tmp_path: Path) -> None:
    """Forward kinematics by 4 x 4 matrices on the model's own joints, as the family defines it."""
    from scipy.spatial.transform import Rotation

    rotvecs, trans, _ = made(waving, count=55)
    betas = np.linspace(-1, 1, 16)
    poses = rotvecs.reshape(len(rotvecs), -1)
    np.savez(tmp_path / "a.npz", poses=poses, trans=trans, betas=betas, mocap_frame_rate=30)
    model = write_model(tmp_path / "M.npz", 55)
    clip = spark_sim.load(tmp_path / "a.npz", up="z", body_model=tmp_path / "M.npz")
    shaped = model["v_template"] + model["shapedirs"][..., :10] @ betas[:10]
    rest = model["J_regressor"] @ shaped
    parents = joints_of(55)[1]
    for t in (0, 40, len(poses) - 1):
        world: list[np.ndarray] = []
        for j, parent in enumerate(parents):
            local = np.eye(4)
            local[:3, :3] = Rotation.from_rotvec(rotvecs[t, j]).as_matrix()
            local[:3, 3] = rest[j] - (rest[parent] if j else 0)
            world.append(local if j == 0 else world[parent] @ local)
        expected = np.array([w[:3, 3] for w in world]) + trans[t]
        np.testing.assert_allclose(forward(clip.motion)[0][t], expected, atol=1e-9)
    assert any("SMPL-X of M.npz with 10 betas" in note for note in clip.notes)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"v_template": None}, "no plain array 'v_template'"),
        ({"J_regressor": np.zeros((55, 399))}, "'J_regressor' is 55 x 399; expected any x 400"),
        ({"kintree_table": np.zeros((2, 55))}, "another tree"),
        ({"J_regressor": np.zeros((5, 400)), "kintree_table": np.zeros((2, 5))}, "has 5 joints"),
        ({"shapedirs": np.array([None])}, "no plain array 'shapedirs'"),
    ],
)
def test_body_models_that_are_none(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    write_model(tmp_path / "M.npz", 55, **changes)
    with pytest.raises(FileFormatError, match=message):
        read_body_model(tmp_path / "M.npz", 55, np.ones(10))
    with pytest.raises(FileFormatError, match="expected a model file such as SMPLX_NEUTRAL"):
        read_body_model(tmp_path / "M.pkl", 55, None)


# What is refused


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"poses": np.zeros((2, 63))}, "'poses' has 21 joints, all but the root"),
        ({"poses": np.zeros((2, 71))}, "71 numbers a frame; expected 3 for each joint"),
        ({"poses": np.full((2, 156), np.nan)}, r"'poses' holds nan at \[0, 0\]"),
        ({"poses": np.zeros((2, 52, 3, 3))}, "no rotations"),
        ({"poses": np.zeros((0, 156))}, "has no frames"),
        ({"poses": np.array(["a"])}, "no real numbers"),
        ({"poses": np.zeros((2, 156)), "trans": np.zeros((3, 3))}, "'trans' has 3 rows of 3 for 2"),
        ({"poses": np.zeros((2, 156)), "mocap_framerate": 0}, "is 0; expected frames a second"),
        ({"pose_body": np.zeros((2, 63))}, "has no 'root_orient'"),
        ({"pose_body": np.zeros((2, 63)), "root_orient": np.zeros((3, 3))}, "'root_orient' is 3"),
        ({"pose_body": np.zeros((2, 60)), "root_orient": np.zeros((2, 3))}, "has 20 joints"),
    ],
)
def test_broken_motions_are_refused(
    tmp_path: Path, content: dict[str, np.ndarray], message: str
) -> None:
    np.savez(tmp_path / "a.npz", **content)
    with pytest.raises(FileFormatError, match=rf"a\.npz: .*{message}"):
        spark_sim.load(tmp_path / "a.npz")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"betas": np.zeros(16), "gender": "male"}, "no motion of a body: expected 'poses'"),
        ({"v_template": np.zeros((4, 3))}, "is a body model and no motion; .*--body-model"),
    ],
)
def test_files_beside_the_motions(
    tmp_path: Path, content: dict[str, np.ndarray], message: str
) -> None:
    np.savez(tmp_path / "a.npz", **content)
    with pytest.raises(FileFormatError, match=rf"a\.npz: .*{message}"):
        spark_sim.load(tmp_path / "a.npz")


@pytest.mark.parametrize("name", ["a.USD", "a.mvnx", "a.blend"])
def test_files_that_are_not_read_say_what_to_do(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"\2P" + bytes(600))
    with pytest.raises(FileFormatError, match=rf"{name}: .*export"):
        spark_sim.load(tmp_path / name)


def test_options_of_other_formats_are_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", poses=np.zeros((2, 156)))
    with pytest.raises(ConventionError, match="quat does not go with such a file"):
        spark_sim.load(tmp_path / "a.npz", quat="xyzw")
    with pytest.raises(ConventionError, match="no frame rate"):
        spark_sim.load(tmp_path / "a.npz", fps=-1.0)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("smpl")


@given(changes=edits)
@settings(deadline=None, max_examples=100)
def test_damaged_files_give_a_recording_or_an_error_of_ours(
    folder: Path, changes: list[tuple[str, int, int]]
) -> None:
    np.savez(folder / "whole.npz", poses=np.zeros((2, 66)), trans=np.zeros((2, 3)), fps=30)
    (folder / "c.npz").write_bytes(damaged((folder / "whole.npz").read_bytes(), changes))
    try:
        read = read_motion(folder / "c.npz")
    except SparkSimError:
        return
    assert np.isfinite(forward(read.motion)[0]).all()


def test_amass_with_its_rate_as_an_object(waving: Motion, tmp_path: Path) -> None:
    rotvecs, trans, _ = made(waving)
    rate, gender = np.array(120.0, dtype=object), np.array("male", dtype=object)
    poses = rotvecs.reshape(len(rotvecs), -1)
    np.savez(tmp_path / "a.npz", poses=poses, trans=trans, mocap_frame_rate=rate, gender=gender)
    read = read_motion(tmp_path / "a.npz")
    assert read.motion.fps == pytest.approx(120)
    assert read.notes[0].startswith("AMASS")
    assert "gender, male" in " ".join(read.notes)


@pytest.mark.parametrize("how", ["matrices", "poses without the root"])
def test_rotations_written_otherwise(how: str, waving: Motion, tmp_path: Path) -> None:
    """The same motion as from vectors of all joints."""
    rotvecs, trans, _ = made(waving)
    body = rotvecs[:, :22]
    np.savez(tmp_path / "a.npz", poses=body.reshape(len(body), -1), trans=trans, fps=30)
    if how == "matrices":
        turned = matrix_from_quat(quat_from_rotvec(body))
        arrays = {"global_orient": turned[:, :1], "body_pose": turned[:, 1:]}
    else:
        arrays = {"root_orient": body[:, 0], "poses": body[:, 1:].reshape(len(body), 63)}
    np.savez(tmp_path / "b.npz", trans=trans, fps=30, **arrays)
    one, other = (read_motion(tmp_path / name).motion for name in ("a.npz", "b.npz"))
    np.testing.assert_allclose(forward(other)[0], forward(one)[0], atol=1e-6)


def test_a_body_without_its_root_is_told(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", poses=np.zeros((5, 63)), trans=np.zeros((5, 3)))
    with pytest.raises(FileFormatError, match="all but the root; expected 'root_orient'"):
        read_motion(tmp_path / "a.npz")
