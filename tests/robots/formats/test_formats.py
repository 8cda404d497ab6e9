"""Files of a robot's motion: what is written is read again, by us and as others do it."""

import json
import pickle
from collections import deque
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pytest
from jaxtyping import Float
from scipy.spatial.transform import Rotation

import spark_sim
from robots import registry
from robots.formats import FORMATS
from robots.formats.made_from import Source
from robots.formats.native import write_npz
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.model.understand import understand_robot
from sim.interpolate import velocities
from spark.errors import ConventionError, FileFormatError, OutputError, SparkSimError
from spark.files import write_atomically
from spark_sim.clips import RobotClip
from spark_sim.loading import load_robot_motion
from tests.helpers.recordings import recordings
from tests.helpers.robot_clips import all_over

FPS, FRAMES = 30.0, 40


@pytest.fixture(scope="module")
def robot() -> Morphology:
    return understand_robot(registry.find("robot"))


@pytest.fixture(scope="module")
def qpos(robot: Morphology) -> Float[np.ndarray, "T nq"]:
    return all_over(robot, FRAMES, 1.0)


@pytest.fixture(scope="module")
def clip(robot: Morphology, qpos: Float[np.ndarray, "T nq"]) -> RobotClip:
    return RobotClip(RobotMotion(robot, robot.from_qpos(qpos), 1 / FPS), "clip")


def given(format: str) -> dict[str, object]:
    """What has to be told of a file in this format."""
    if format == "npz":
        return {}
    if FORMATS[format] == ".csv":
        return {"robot": "robot", "quat": "wxyz" if format == "csv-wxyz" else "xyzw", "fps": FPS}
    return {"robot": "robot"}


FILES = {name: ending for name, ending in FORMATS.items() if ending}


@pytest.mark.parametrize("format", FILES)
def test_there_and_back(
    format: str, clip: RobotClip, qpos: Float[np.ndarray, "T nq"], tmp_path: Path
) -> None:
    written = clip.save(tmp_path / f"clip{FORMATS[format]}", format=format)
    back = spark_sim.load(written, **given(format))
    assert isinstance(back, RobotClip)
    read = back.on_robot.qpos
    read[:, 3:7] *= np.sign((read[:, 3:7] * qpos[:, 3:7]).sum(1))[:, None]
    np.testing.assert_allclose(read, qpos, atol=1e-6)
    assert back.motion.frame_time == pytest.approx(1 / FPS, abs=1e-12)


def test_our_npz_says_all_that_is_needed(
    clip: RobotClip, qpos: Float[np.ndarray, "T nq"], tmp_path: Path
) -> None:
    with np.load(clip.save(tmp_path / "clip.npz"), allow_pickle=False) as stored:
        about = json.loads(str(stored["about"]))
        model = mujoco.MjModel.from_xml_path(str(registry.find("robot")))
        assert stored["joint_names"].tolist() == [model.joint(j).name for j in range(1, model.njnt)]
        assert stored["body_names"].tolist() == [model.body(b).name for b in range(1, model.nbody)]
        assert (about["robot"], about["quaternion"]) == ("robot", "wxyz")
        assert float(stored["fps"]) == pytest.approx(FPS)
        # MuJoCo's own integration with qvel leads from frame to frame.
        for t in range(1, FRAMES - 2):
            moved = stored["qpos"][t].copy()
            mujoco.mj_integratePos(model, moved, stored["qvel"][t], 1 / FPS)
            assert np.abs(moved - stored["qpos"][t + 1]).max() < 5e-3


def test_qvel_of_an_even_motion_is_exact(robot: Morphology) -> None:
    model, dt = robot.mjcf.model, 0.02
    rate = np.random.default_rng(1).normal(size=model.nv)
    qpos = [np.array([0, 0, 1.0, *([0.5] * 4), *np.zeros(model.nq - 7)])]
    for _ in range(5):
        qpos.append(qpos[-1].copy())
        mujoco.mj_integratePos(model, qpos[-1], rate, dt)
    np.testing.assert_allclose(velocities(model, np.array(qpos), dt), np.tile(rate, (6, 1)))


def test_csv_has_unitree_s_columns(
    clip: RobotClip, qpos: Float[np.ndarray, "T nq"], tmp_path: Path
) -> None:
    table = np.loadtxt(clip.save(tmp_path / "clip.csv"), delimiter=",")
    assert table.shape == (FRAMES, 36)
    np.testing.assert_allclose(table[:, :3], qpos[:, :3], atol=1e-8)
    turned, meant = (Rotation.from_quat(q) for q in (table[:, 3:7], np.roll(qpos[:, 3:7], -1, 1)))
    assert (turned * meant.inv()).magnitude().max() < 1e-7
    np.testing.assert_allclose(table[:, 7:], qpos[:, 7:], atol=1e-8)


def test_mjlab_has_the_bodies_where_mujoco_has_them(
    clip: RobotClip, qpos: Float[np.ndarray, "T nq"], tmp_path: Path
) -> None:
    model = mujoco.MjModel.from_xml_path(str(registry.find("robot")))
    data = mujoco.MjData(model)
    stored = np.load(clip.save(tmp_path / "clip.npz", format="mjlab"), allow_pickle=False)
    assert stored["joint_names"].tolist() == [model.joint(j).name for j in range(1, model.njnt)]
    assert stored["body_names"].tolist() == [model.body(b).name for b in range(1, model.nbody)]
    assert (str(stored["order"]), str(stored["quaternion"])) == ("MuJoCo", "wxyz")
    qvel = velocities(model, qpos, 1 / FPS)
    for t in (5, 20):
        data.qpos[:], data.qvel[:] = qpos[t], qvel[t]
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(stored["body_pos_w"][t], data.xpos[1:], atol=1e-6)
        for k, body in enumerate(range(1, model.nbody)):
            moving = np.zeros(6)
            mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, moving, 0)
            np.testing.assert_allclose(stored["body_ang_vel_w"][t, k], moving[:3], atol=0.02)
            np.testing.assert_allclose(stored["body_lin_vel_w"][t, k], moving[3:], atol=0.02)


def breadth_first(model: mujoco.MjModel) -> list[int]:
    """The bodies level by level, as a queue visits them."""
    order, waiting = [], deque([1])
    while waiting:
        body = waiting.popleft()
        order.append(body)
        waiting += [b for b in range(2, model.nbody) if model.body_parentid[b] == body]
    return order


@pytest.mark.parametrize("quat", ["wxyz", "xyzw"])
def test_isaac_lab_s_order_is_seen(
    quat: str, clip: RobotClip, qpos: Float[np.ndarray, "T nq"], tmp_path: Path
) -> None:
    """Joints and bodies level by level, which no key of the file says."""
    model = mujoco.MjModel.from_xml_path(str(registry.find("robot")))
    order = breadth_first(model)
    joints = [int(model.body_jntadr[b]) - 1 for b in order[1:]]
    assert joints != sorted(joints)
    arrays = dict(np.load(clip.save(tmp_path / "clip.npz", format="mjlab")))
    del arrays["joint_names"]  # as other tools write it
    bodies = [b - 1 for b in order]
    for name, columns in (("joint_pos", joints), ("body_pos_w", bodies), ("body_quat_w", bodies)):
        arrays[name] = arrays[name][:, columns]
    if quat == "xyzw":
        arrays["body_quat_w"] = np.roll(arrays["body_quat_w"], -1, axis=-1)
    np.savez(tmp_path / "isaac.npz", **arrays)
    back = load_robot_motion(tmp_path / "isaac.npz", robot="robot")
    np.testing.assert_allclose(back.on_robot.qpos[:, 7:], qpos[:, 7:], atol=1e-6)
    assert any(f"breadth-first order, quaternions as {quat}" in note for note in back.notes)


def test_mjlab_of_another_robot_is_refused(clip: RobotClip, tmp_path: Path) -> None:
    arrays = dict(np.load(clip.save(tmp_path / "clip.npz", format="mjlab")))
    arrays["body_pos_w"][:, 5:] += 0.1
    np.savez(tmp_path / "other.npz", **arrays)
    with pytest.raises(FileFormatError, match="of another robot"):
        load_robot_motion(tmp_path / "other.npz", robot="robot")


def test_few_bodies_may_leave_the_order_open(clip: RobotClip, tmp_path: Path) -> None:
    """Trackers keep some of the bodies: feet and hands tell the order, the root alone doesn't."""
    arrays = dict(np.load(clip.save(tmp_path / "clip.npz", format="mjlab")))
    del arrays["joint_names"]
    for kept, says in (([0, 6, 12, 29], "as the bodies' places show"), ([0], "don't show it")):
        bodies = [name for name in arrays if name.startswith("body") and name.endswith("_w")]
        few = {k: v[:, kept] if k in bodies else v for k, v in arrays.items()}
        np.savez(tmp_path / "few.npz", **few)
        read = load_robot_motion(tmp_path / "few.npz", robot="robot")
        np.testing.assert_allclose(read.on_robot.qpos[:, 7:], clip.on_robot.qpos[:, 7:], atol=1e-6)
        assert any("depth-first" in note and says in note for note in read.notes)


def test_gmr_s_entries(clip: RobotClip, qpos: Float[np.ndarray, "T nq"], tmp_path: Path) -> None:
    entries = pickle.loads(clip.save(tmp_path / "clip.pkl").read_bytes())
    keys = ["fps", "root_pos", "root_rot", "dof_pos", "local_body_pos", "link_body_list"]
    assert list(entries) == keys
    assert entries["fps"] == 30
    assert isinstance(entries["fps"], int)
    model = mujoco.MjModel.from_xml_path(str(registry.find("robot")))
    data = mujoco.MjData(model)
    data.qpos[:] = [0, 0, 0, 1, 0, 0, 0, *qpos[7, 7:]]
    mujoco.mj_kinematics(model, data)
    np.testing.assert_allclose(entries["local_body_pos"][7], data.xpos[1:], atol=1e-6)
    assert entries["link_body_list"] == [model.body(b).name for b in range(1, model.nbody)]
    turned = Rotation.from_quat(entries["root_rot"])
    assert (
        turned * Rotation.from_quat(np.roll(qpos[:, 3:7], -1, 1)).inv()
    ).magnitude().max() < 1e-6


@pytest.mark.parametrize("protocol", range(6))
def test_pickles_of_any_protocol_are_read(
    protocol: int, qpos: Float[np.ndarray, "T nq"], tmp_path: Path
) -> None:
    entries = {
        "fps": np.float64(30),
        "root_pos": qpos[:, :3],
        "root_rot": np.roll(qpos[:, 3:7], -1, 1).astype(np.float32),
        "dof_pos": qpos[:, 7:],
        "local_body_pos": None,
        "link_body_list": None,
    }
    (tmp_path / "gmr.pkl").write_bytes(pickle.dumps(entries, protocol=protocol))
    back = load_robot_motion(tmp_path / "gmr.pkl", robot="robot")
    np.testing.assert_allclose(back.on_robot.qpos[:, 7:], qpos[:, 7:], atol=1e-12)


class Evil:
    """Writes a file when it is unpickled."""

    def __init__(self, path: Path, call: Callable[..., object]) -> None:
        self.reduced = call, (path, b"gotcha")

    def __reduce__(self) -> tuple[Callable[..., object], tuple[Path, bytes]]:
        return self.reduced


def test_a_pickle_s_program_is_not_run(tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    data = pickle.dumps({"fps": 30, "root_pos": Evil(mark, write_atomically)})
    (tmp_path / "evil.pkl").write_bytes(data)
    with pytest.raises(FileFormatError, match="can run any program"):
        load_robot_motion(tmp_path / "evil.pkl", robot="robot")
    assert not mark.exists()
    pickle.loads(data)  # the attack is one
    assert mark.exists()


@pytest.mark.parametrize("what", ["builtins eval", "numpy load", "numpy.core.multiarray fromfile"])
def test_only_the_making_of_arrays_may_be_called(what: str, tmp_path: Path) -> None:
    module, name = what.split()
    (tmp_path / "evil.pkl").write_bytes(f"c{module}\n{name}\n(S'1'\ntR.".encode())
    with pytest.raises(FileFormatError, match=f"{module}.{name}"):
        load_robot_motion(tmp_path / "evil.pkl", robot="robot")


def rows(qpos: Float[np.ndarray, "T nq"]) -> list[str]:
    table = np.concatenate([qpos[:, :3], np.roll(qpos[:, 3:7], -1, 1), qpos[:, 7:]], 1)
    return [",".join(f"{value:.6f}" for value in row) for row in table]


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda r: [], r"clip\.csv: is empty"),
        (lambda r: ["x,y,z", *r], r"clip\.csv:1: column 1 is 'x'; expected numbers, and no header"),
        (lambda r: [*r[:3], r[3] + ",0", *r[4:]], r"clip\.csv:4: has 37 columns, .* have 36"),
        (lambda r: [r[0], "", "nan" + r[1][8:]], r"clip\.csv:3: column 1 is nan"),
        (lambda r: [*r[:5], r[5].replace(",", ";")], r"clip\.csv:6: column 1 is '"),
        (lambda r: [row + ",0" for row in r], r"moves 30 joints; the robot 'ember' has 29"),
        (lambda r: ["0," + row for row in r], "moves 30 joints"),
        (lambda r: [row[: row.index(",", 40)] for row in r], r"columns; expected 7|joints; "),
        (lambda r: ["0,0,1,1,1,1,1" + ",0" * 29], "frame 0 has length 2; expected 1"),
        (lambda r: ["0,0,1,0,0,0,0" + ",0" * 29], "frame 0 has length 0; expected 1"),
    ],
)
def test_spoilt_csv(
    spoil: Callable[[list[str]], list[str]],
    says: str,
    qpos: Float[np.ndarray, "T nq"],
    tmp_path: Path,
) -> None:
    (tmp_path / "clip.csv").write_text("\n".join(spoil(rows(qpos))))
    with pytest.raises(FileFormatError, match=says):
        spark_sim.load(tmp_path / "clip.csv", robot="robot", quat="xyzw", fps=FPS)


def test_what_a_csv_does_not_say_is_asked_for_at_once(clip: RobotClip, tmp_path: Path) -> None:
    upright = RobotClip(
        RobotMotion(clip.on_robot.robot, clip.on_robot.robot.tpose, 1 / FPS), "upright"
    )
    turned = upright.on_robot.qpos.copy()
    turned[:, 3:7] = Rotation.from_euler("zx", [1.2, 0.2]).as_quat(scalar_first=True)
    path = tmp_path / "clip.csv"
    path.write_text("\n".join(rows(turned)))
    with pytest.raises(ConventionError, match=r"--robot.*--quat.*upright only as xyzw.*--fps"):
        spark_sim.load(path)
    with pytest.raises(ConventionError) as caught:
        spark_sim.load(path, robot="robot", fps=FPS)
    assert "--robot" not in str(caught.value)
    read = spark_sim.load(path, robot="robot", quat="wxyz", fps=FPS)
    assert "as wxyz the robot does not stand upright, as xyzw it does" in " ".join(read.notes)
    assert not spark_sim.load(path, robot="robot", quat="xyzw", fps=FPS).notes


@pytest.mark.parametrize("fps", [0.0, -30.0, float("nan"), float("inf")])
def test_a_rate_must_be_one(fps: float, clip: RobotClip, tmp_path: Path) -> None:
    written = clip.save(tmp_path / "clip.csv")
    with pytest.raises(SparkSimError, match="fps is"):
        spark_sim.load(written, robot="robot", quat="xyzw", fps=fps)


def test_small_deviations_are_normalised_and_said(
    clip: RobotClip, qpos: Float[np.ndarray, "T nq"], tmp_path: Path
) -> None:
    rough = qpos.copy()
    rough[:, 3:7] *= 1.01
    (tmp_path / "clip.csv").write_text("\n".join(rows(rough)))
    read = load_robot_motion(tmp_path / "clip.csv", robot="robot", quat="xyzw", fps=FPS)
    np.testing.assert_allclose(np.linalg.norm(read.on_robot.qpos[:, 3:7], axis=1), 1)
    assert any("0.01 off unit length" in note for note in read.notes)


def test_arrays_without_a_motion_are_named_and_no_robot_is_asked_for(tmp_path: Path) -> None:
    np.savez(tmp_path / "photos.npz", pixels=np.zeros(3))
    with pytest.raises(FileFormatError, match="nor mjlab's 'joint_pos'; it holds 'pixels'"):
        load_robot_motion(tmp_path / "photos.npz")


@pytest.mark.parametrize(
    ("format", "change", "says"),
    [
        ("npz", {"qpos": None}, "has no 'qpos'; it holds 'qvel'"),
        ("npz", {"about": np.array("{}")}, "has the schema None"),
        ("npz", {"about": np.array("no json")}, "no JSON"),
        ("npz", {"qpos": np.zeros((3, 7))}, "'qpos' is 3 x 7; expected any x 36"),
        ("npz", {"qpos": np.full((3, 36), np.nan)}, r"qpos\[0\] is nan in frame 0"),
        ("npz", {"qpos": np.array("text")}, "'qpos' holds no numbers"),
        ("npz", {"frame_time": np.array(0.0)}, "frame_time is 0"),
        ("npz", {"fps": np.array(7.0)}, "tells two rates: 'fps' is 7, and another entry says"),
        ("npz", {"joint_names": np.array(["a", "b"])}, "its joint 'a' is not there"),
        ("mjlab", {"fps": None}, "no 'fps'"),
        ("mjlab", {"body_pos_w": None}, "no 'body_pos_w'"),
        (
            "mjlab",
            {"joint_pos": np.zeros((FRAMES, 23))},
            "'joint_pos' is 40 x 23; expected any x 29",
        ),
        ("mjlab", {"body_pos_w": np.zeros((3, 30, 3))}, "'body_pos_w' is 3 x 30 x 3; expected 40"),
        ("mjlab", {"fps": np.array([1.0, 2.0])}, "'fps' is 2; expected one number"),
    ],
)
def test_spoilt_npz(
    format: str, change: dict[str, object], says: str, clip: RobotClip, tmp_path: Path
) -> None:
    arrays = dict(np.load(clip.save(tmp_path / "clip.npz", format=format)))
    arrays = {k: v for k, v in (arrays | change).items() if v is not None}
    np.savez(tmp_path / "bad.npz", **arrays)
    with pytest.raises(SparkSimError, match=says):
        load_robot_motion(tmp_path / "bad.npz", robot="robot")


@pytest.mark.parametrize(
    ("entries", "says"),
    [
        ([1, 2], "holds a list; expected a dict"),
        ({"fps": 30, "root": 1}, "has no 'root_pos'; it holds 'fps', 'root'"),
        ({"root_pos": np.zeros((2, 3)), "root_rot": np.zeros((3, 4))}, "expected 2 x 4"),
    ],
)
def test_spoilt_pickle(entries: object, says: str, tmp_path: Path) -> None:
    (tmp_path / "bad.pkl").write_bytes(pickle.dumps(entries))
    with pytest.raises(FileFormatError, match=says):
        load_robot_motion(tmp_path / "bad.pkl", robot="robot")


@pytest.mark.parametrize("suffix", [".npz", ".pkl", ".csv"])
@pytest.mark.parametrize(
    "data", [b"", b"\x80\x04", b"PK\x03\x04 no zip", b"\x93NUMPY", b"\xff" * 99]
)
def test_what_is_no_file_of_its_kind(data: bytes, suffix: str, tmp_path: Path) -> None:
    path = tmp_path / f"bad{suffix}"
    path.write_bytes(data)
    told = {"quat": "xyzw", "fps": 30.0} if suffix == ".csv" else {}
    with pytest.raises(FileFormatError, match=rf"bad{suffix}"):
        spark_sim.load(path, robot="robot", **told)


def test_cut_off_files_are_refused(clip: RobotClip, tmp_path: Path) -> None:
    for format, suffix in FILES.items():
        written = clip.save(tmp_path / f"{format}{suffix}", format=format)
        data = written.read_bytes()
        for share in (0.2, 0.55, 0.9):
            written.write_bytes(data[: int(len(data) * share)])
            with pytest.raises(SparkSimError, match=format):
                spark_sim.load(written, **given(format))


def test_npz_with_objects_is_not_unpickled(clip: RobotClip, tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    np.savez(tmp_path / "evil.npz", qpos=np.array([Evil(mark, write_atomically)], dtype=object))
    with pytest.raises(FileFormatError, match="'qpos' can't be read"):
        load_robot_motion(tmp_path / "evil.npz", robot="robot")
    assert not mark.exists()


def test_a_changed_model_is_said_and_another_refused(clip: RobotClip, tmp_path: Path) -> None:
    model = tmp_path / "ember.xml"
    text = registry.find("robot").read_text()
    model.write_text(text)
    same = RobotMotion(understand_robot(model), clip.on_robot.coordinates, 1 / FPS)
    written = RobotClip(same, "same").save(tmp_path / "clip.npz")
    assert not spark_sim.load(written).notes
    model.write_text(text.replace('pos="0 0 0.74"', 'pos="0 0 0.75"'))
    assert any("has changed" in note for note in spark_sim.load(written).notes)
    model.write_text(text.replace("left_knee", "left_bend"))
    with pytest.raises(FileFormatError, match="its joint 'left_knee' is not there"):
        spark_sim.load(written)
    model.unlink()
    with pytest.raises(FileFormatError, match="name it with --robot"):
        spark_sim.load(written)
    assert spark_sim.load(written, robot="robot").motion.frame_time == pytest.approx(1 / FPS)


def test_a_model_is_found_where_it_lay_while_it_is_the_same(
    clip: RobotClip, tmp_path: Path
) -> None:
    """Beside the place of a model without a name, no folder of the machine is told."""
    elsewhere = tmp_path / "at_home"
    elsewhere.mkdir()
    model = elsewhere / "own.xml"
    model.write_text(registry.find("robot").read_text())
    for place in (elsewhere, tmp_path / "out", elsewhere / "takes"):
        place.mkdir(exist_ok=True)
        own = understand_robot(model)
        notes = (f"no mesh '{elsewhere}/hand.stl'",)
        written = place / "clip.npz"
        moved = RobotMotion(own, own.from_qpos(clip.on_robot.qpos), 1 / FPS, notes)
        write_npz(moved, written, source=Source(tmp_path / "a.bvh"))
        with np.load(written) as stored:
            about = json.loads(str(stored["about"]))
        assert about.pop("model_path") == str(model)
        assert str(tmp_path) not in json.dumps(about)
        assert (about["model"], about["notes"]) == ("own.xml", ["no mesh 'hand.stl'"])
        assert spark_sim.load(written).frame_time == pytest.approx(1 / FPS)
    model.write_text(model.read_text().replace('pos="0 0 0.74"', 'pos="0 0 0.75"'))
    assert any("has changed" in n for n in spark_sim.load(elsewhere / "clip.npz").notes)
    with pytest.raises(FileFormatError, match=r"'own.xml', which is neither beside it nor here"):
        spark_sim.load(tmp_path / "out" / "clip.npz")


def test_a_robot_with_a_name_is_told_by_it_alone(clip: RobotClip, tmp_path: Path) -> None:
    with np.load(clip.save(tmp_path / "clip.npz")) as stored:
        about = json.loads(str(stored["about"]))
    assert (about["robot"], about["model_path"]) == ("robot", None)


def test_our_npz_says_where_base_and_joints_are_in_qpos(
    clip: RobotClip, qpos: Float[np.ndarray, "T nq"], tmp_path: Path
) -> None:
    """A ball and a door before the robot take the first columns."""
    beside = (
        '<body name="ball" pos="2 0 1"><freejoint/><geom size="0.1"/></body>'
        '<body name="door" pos="3 0 1"><joint/><geom size="0.1"/></body>'
    )
    text = registry.find("robot").read_text()
    (tmp_path / "own.xml").write_text(text.replace("<worldbody>", f"<worldbody>{beside}", 1))
    own = understand_robot(tmp_path / "own.xml")
    (note,) = [note for note in own.notes if "beside the robot" in note]
    assert "'ball', 'door' can move" in note
    assert "columns 8 to 14 of qpos" in note
    wide = np.hstack([np.tile(own.mjcf.model.qpos0[:8], (FRAMES, 1)), qpos])
    write_npz(RobotMotion(own, own.from_qpos(wide), 1 / FPS), tmp_path / "clip.npz")
    with np.load(tmp_path / "clip.npz") as stored:
        about = json.loads(str(stored["about"]))
        base, joints = about["base_qposadr"], about["joint_qposadr"]
        np.testing.assert_allclose(stored["qpos"][:, base : base + 3], qpos[:, :3])
        for name, column in zip(stored["joint_names"], joints, strict=True):
            np.testing.assert_allclose(stored["qpos"][:, column], clip.joints[str(name)])


def test_a_model_is_found_where_one_works_and_where_older_files_say(
    clip: RobotClip, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "models").mkdir()
    model = tmp_path / "models" / "own.xml"
    model.write_text(registry.find("robot").read_text())
    own = understand_robot(model)
    written = tmp_path / "clip.npz"
    write_npz(RobotMotion(own, own.from_qpos(clip.on_robot.qpos), 1 / FPS), written)
    with np.load(written) as stored:
        assert json.loads(str(stored["about"]))["model"] == "models/own.xml"
        arrays = dict(stored)
    moved = tmp_path / "far" / "clip.npz"
    moved.parent.mkdir()
    written.rename(moved)
    monkeypatch.chdir(tmp_path)
    assert spark_sim.load(moved).on_robot.robot.mjcf.path.name == "own.xml"
    about = json.loads(str(arrays["about"]))
    about["model"] = str(model)  # as the first versions wrote it
    monkeypatch.chdir(moved.parent)
    np.savez(moved, **{**arrays, "about": np.array(json.dumps(about))})
    assert spark_sim.load(moved).on_robot.robot.mjcf.path == model


def test_an_included_model_that_changed_is_seen(clip: RobotClip, tmp_path: Path) -> None:
    (tmp_path / "ember.xml").write_text(registry.find("robot").read_text())
    scene = tmp_path / "scene.xml"
    scene.write_text('<mujoco><include file="ember.xml"/></mujoco>')
    on_scene = RobotMotion(understand_robot(scene), clip.on_robot.coordinates, 1 / FPS)
    written = RobotClip(on_scene, "on scene").save(tmp_path / "clip.npz")
    assert not spark_sim.load(written).notes
    with (tmp_path / "ember.xml").open("a") as file:
        file.write("<!-- edited -->")
    assert any("has changed" in note for note in spark_sim.load(written).notes)


def test_endings_and_formats_must_agree(clip: RobotClip, tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"written as \.npz, \.csv, \.pkl, \.motion"):
        clip.save(tmp_path / "clip.bvh")
    with pytest.raises(OutputError, match=r"'gmr' is written as \.pkl"):
        clip.save(tmp_path / "clip.npz", format="gmr")
    clip.save(tmp_path / "clip.npz")
    with pytest.raises(OutputError, match="exists"):
        clip.save(tmp_path / "clip.npz")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["clip.npz"]


def test_limits_that_are_left_are_said(
    clip: RobotClip, qpos: Float[np.ndarray, "T nq"], tmp_path: Path
) -> None:
    far = qpos.copy()
    far[:, 10] = 3.0
    (tmp_path / "clip.csv").write_text("\n".join(rows(far)))
    read = load_robot_motion(tmp_path / "clip.csv", robot="robot", quat="xyzw", fps=FPS)
    assert any("'left_knee' goes 29 degrees beyond" in note for note in read.notes)


def test_other_units_and_robots_are_suspected(
    qpos: Float[np.ndarray, "T nq"], tmp_path: Path
) -> None:
    path = tmp_path / "clip.csv"
    far = qpos.copy()
    far[:, :3] *= 100
    path.write_text("\n".join(rows(far)))
    read = load_robot_motion(path, robot="robot", quat="xyzw", fps=FPS)
    assert any("the base is 70 m high: positions are read as metres" in n for n in read.notes)
    path.write_text("\n".join(row.rsplit(",", 10)[0] for row in rows(qpos)))
    with pytest.raises(FileFormatError, match="of another robot, such as 'unitree_h1'"):
        load_robot_motion(path, robot="robot", quat="xyzw", fps=FPS)


@pytest.mark.parametrize("path", recordings("g1moves/M_ShortMove1*.csv"))
def test_recordings_of_a_g1_stand_on_their_feet(path: Path) -> None:
    g1 = spark_sim.load(path, robot="unitree_g1", quat="xyzw", fps=60.0)
    assert isinstance(g1, RobotClip)
    assert g1.notes == ()
    table = np.loadtxt(path, delimiter=",")
    np.testing.assert_allclose(g1.on_robot.qpos[:, 7:], table[:, 7:], atol=1e-9)
    positions = spark_sim.retarget(g1, "robot").motion.root_pos
    assert len(positions) == len(table)
    assert 0.55 < np.median(positions[:, 2]) < 0.8
