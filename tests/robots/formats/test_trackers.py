"""What motion trackers load: each format by its project's own documents, and read again."""

import json
import re
from pathlib import Path
from random import Random

import mujoco
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from jaxtyping import Float
from scipy.spatial.transform import Rotation

import spark_sim
from robots.formats import FORMATS, SIDECARS, SONIC_FILES, written_files
from robots.model.known import known
from robots.model.motion import RobotMotion
from spark.errors import ConventionError, FileFormatError, OutputError, SparkSimError
from spark_sim.clips import RobotClip
from tests.helpers.robot_clips import all_over

FPS, FRAMES = 50.0, 30

LEG = ("hip_pitch", "hip_roll", "hip_yaw", "knee", "ankle_pitch", "ankle_roll")
ARM = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow")
WRIST = ("wrist_roll", "wrist_pitch", "wrist_yaw")
# How Isaac Lab numbers the G1's joints, as SONIC's deployment and BeyondMimic have them: where each
# is in the order of the motors (left leg, right leg, waist, left arm, right arm).
ISAAC_G1 = (
    *(0, 6, 12, 1, 7, 13, 2, 8, 14, 3, 9, 15, 22, 4, 10, 16, 23, 5, 11, 17, 24),
    *(18, 25, 19, 26, 20, 27, 21, 28),
)
MOTORS_G1 = (
    *(f"left_{name}_joint" for name in LEG),
    *(f"right_{name}_joint" for name in LEG),
    *(f"waist_{axis}_joint" for axis in ("yaw", "roll", "pitch")),
    *(f"left_{name}_joint" for name in ARM + WRIST),
    *(f"right_{name}_joint" for name in ARM + WRIST),
)
# The bodies that SONIC's own motions have, by their numbers in Isaac Lab.
SONIC_BODIES = {
    0: "pelvis",
    4: "left_hip_roll_link",
    10: "left_knee_link",
    18: "left_ankle_roll_link",
    5: "right_hip_roll_link",
    11: "right_knee_link",
    19: "right_ankle_roll_link",
    9: "torso_link",
    16: "left_shoulder_roll_link",
    22: "left_elbow_link",
    28: "left_wrist_yaw_link",
    17: "right_shoulder_roll_link",
    23: "right_elbow_link",
    29: "right_wrist_yaw_link",
}


def moving(name: str) -> RobotClip:
    """A smooth motion all over the joints' ranges, the base turning over."""
    robot = known(name)
    q = robot.from_qpos(all_over(robot, FRAMES, 0.6))
    return RobotClip(RobotMotion(robot, q, 1 / FPS), "clip")


@pytest.fixture(scope="module")
def clip() -> RobotClip:
    return moving("robot")


@pytest.fixture(scope="module")
def g1() -> RobotClip:
    return moving("unitree_g1")


def model_of(clip: RobotClip) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(clip.on_robot.robot.mjcf.path))


def test_isaac_lab_s_order_is_the_g1_s(g1: RobotClip, tmp_path: Path) -> None:
    stored = np.load(g1.save(tmp_path / "clip.npz", format="beyondmimic"))
    assert stored["joint_names"].tolist() == [MOTORS_G1[k] for k in ISAAC_G1]
    bodies = stored["body_names"].tolist()
    assert len(bodies) == 30
    assert {k: bodies[k] for k in SONIC_BODIES} == SONIC_BODIES
    model, data = model_of(g1), mujoco.MjData(model_of(g1))
    for t in (0, 11, FRAMES - 1):
        data.qpos[:3], data.qpos[3:7] = stored["body_pos_w"][t, 0], stored["body_quat_w"][t, 0]
        for k, name in enumerate(stored["joint_names"].tolist()):
            data.joint(name).qpos[0] = stored["joint_pos"][t, k]
        mujoco.mj_kinematics(model, data)
        for k, name in enumerate(bodies):
            np.testing.assert_allclose(stored["body_pos_w"][t, k], data.body(name).xpos, atol=1e-5)
            off = np.abs(stored["body_quat_w"][t, k] @ data.body(name).xquat)
            assert off == pytest.approx(1, abs=1e-6)


@pytest.mark.parametrize(
    ("format", "kind"),
    [("mjlab", mujoco.mjtObj.mjOBJ_XBODY), ("beyondmimic", mujoco.mjtObj.mjOBJ_BODY)],
)
def test_velocities_are_of_the_point_that_each_project_means(
    format: str, kind: mujoco.mjtObj, clip: RobotClip, tmp_path: Path
) -> None:
    """mjlab's are of a link's origin, Isaac Lab's `body_lin_vel_w` of its centre of mass."""
    stored = np.load(clip.save(tmp_path / "clip.npz", format=format))
    model = model_of(clip)
    data = mujoco.MjData(model)
    t = 12
    data.qpos[:] = clip.qpos[t]
    mujoco.mj_differentiatePos(model, data.qvel, 2 / FPS, clip.qpos[t - 1], clip.qpos[t + 1])
    mujoco.mj_forward(model, data)
    for k, name in enumerate(stored["body_names"].tolist()):
        twist = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, kind, model.body(name).id, twist, 0)
        np.testing.assert_allclose(stored["body_ang_vel_w"][t, k], twist[:3], atol=0.02)
        np.testing.assert_allclose(stored["body_lin_vel_w"][t, k], twist[3:], atol=0.02)


def csv(path: Path) -> tuple[list[str], Float[np.ndarray, "T C"]]:
    header, *rows = path.read_text().splitlines()
    return header.split(","), np.array([row.split(",") for row in rows], dtype=float)


def test_sonic_s_folder_is_what_its_reader_wants(g1: RobotClip, tmp_path: Path) -> None:
    folder = g1.save(tmp_path / "motions" / "clip", format="sonic")
    assert {path.name for path in folder.iterdir()} == set(SONIC_FILES)
    tables = {name: csv(folder / name) for name in SONIC_FILES if name.endswith(".csv")}
    assert {len(table) for _, table in tables.values()} == {FRAMES}
    assert tables["joint_pos.csv"][0] == [f"joint_{k}" for k in range(29)]
    assert tables["joint_vel.csv"][0] == [f"joint_vel_{k}" for k in range(29)]
    assert tables["body_pos.csv"][0][:4] == ["body_0_x", "body_0_y", "body_0_z", "body_1_x"]
    assert tables["body_quat.csv"][0][:4] == [f"body_0_{axis}" for axis in "wxyz"]
    bodies = re.search(r"Body part indexes:\n\[([\d ]+)\]", (folder / "metadata.txt").read_text())
    assert bodies is not None
    assert [int(k) for k in bodies[1].split()] == list(range(30))
    for name in ("body_pos", "body_lin_vel", "body_ang_vel"):
        assert tables[f"{name}.csv"][1].shape[1] == 3 * 30
    motors = g1.qpos[:, 7:]
    np.testing.assert_allclose(tables["joint_pos.csv"][1], motors[:, ISAAC_G1], atol=1e-8)
    np.testing.assert_allclose(tables["body_pos.csv"][1][:, :3], g1.qpos[:, :3], atol=1e-8)
    np.testing.assert_allclose(tables["body_quat.csv"][1][:, :4], g1.qpos[:, 3:7], atol=1e-8)
    back = spark_sim.load(folder)  # info.txt says the robot
    assert isinstance(back, RobotClip)
    np.testing.assert_allclose(back.qpos, g1.qpos, atol=1e-8)
    with pytest.raises(OutputError, match="exists"):
        g1.save(folder, format="sonic")
    with pytest.raises(OutputError, match=r"50 frames a second.*add --fps 50"):
        g1.resampled(30.0).save(tmp_path / "slow", format="sonic")
    with pytest.raises(OutputError, match="is a folder; name it without"):
        g1.save(tmp_path / "clip.csv", format="sonic")


def test_a_root_alone_is_enough_to_read_sonic_s(clip: RobotClip, tmp_path: Path) -> None:
    """The smallest set of files that its documents allow."""
    folder = clip.save(tmp_path / "clip", format="sonic")
    for name in ("body_lin_vel.csv", "body_ang_vel.csv", "info.txt"):
        (folder / name).unlink()
    for name, width in (("body_pos", 3), ("body_quat", 4)):
        lines = (folder / f"{name}.csv").read_text().splitlines()
        (folder / f"{name}.csv").write_text(
            "\n".join(",".join(x.split(",")[:width]) for x in lines)
        )
    (folder / "metadata.txt").write_text("Body part indexes:\n[0]\n")
    with pytest.raises(ConventionError, match="--robot"):
        spark_sim.load(folder)
    back = spark_sim.load(folder, robot="robot")
    assert isinstance(back, RobotClip)
    np.testing.assert_allclose(back.qpos, clip.qpos, atol=1e-8)
    (folder / "metadata.txt").write_text("Body part indexes:\n[ 4 0]\n")
    with pytest.raises(FileFormatError, match="the first body is number 4"):
        spark_sim.load(folder, robot="robot")


def test_bones_seed_s_columns(g1: RobotClip, tmp_path: Path) -> None:
    header, table = csv(g1.save(tmp_path / "clip.csv", format="bones-seed"))
    root = ["root_translateX", "root_translateY", "root_translateZ"]
    root += ["root_rotateX", "root_rotateY", "root_rotateZ"]
    assert header == ["Frame", *root, *(f"{name}_dof" for name in MOTORS_G1)]
    np.testing.assert_array_equal(table[:, 0], np.arange(FRAMES))
    np.testing.assert_allclose(table[:, 1:4], 100 * g1.qpos[:, :3], atol=1e-6)
    np.testing.assert_allclose(table[:, 7:], np.degrees(g1.qpos[:, 7:]), atol=1e-6)
    # as ProtoMotions' converter reads them: extrinsic xyz, degrees
    read = Rotation.from_euler("xyz", table[:, 4:7], degrees=True).as_quat(scalar_first=True)
    assert np.abs(np.sum(read * g1.qpos[:, 3:7], axis=1)).min() > 1 - 1e-12


def test_bones_seed_s_joints_are_found_by_name(clip: RobotClip, tmp_path: Path) -> None:
    path = clip.save(tmp_path / "clip.csv", format="bones-seed")
    header, table = csv(path)
    order = [0, *np.random.default_rng(0).permutation(np.arange(1, len(header))), 0]
    names = [header[k] for k in order[:-1]] + ["left_finger_dof"]
    rows = [",".join(names), *(",".join(f"{x:.6f}" for x in row) for row in table[:, order])]
    other = tmp_path / "other.csv"
    other.write_text("\n".join(rows))
    with pytest.raises(ConventionError, match=r"--robot NAME; its frame rate.*have 120"):
        spark_sim.load(other)
    back = spark_sim.load(other, robot="robot", fps=FPS)
    assert isinstance(back, RobotClip)
    assert np.abs(back.qpos[:, 7:] - clip.qpos[:, 7:]).max() < 1e-7
    assert "'left_finger_dof'" in " ".join(back.notes)
    other.write_text(path.read_text().replace("left_knee_dof", "left_bend_dof"))
    with pytest.raises(FileFormatError, match=r"other.csv:1: has no column 'left_knee_dof'"):
        spark_sim.load(other, robot="robot", fps=FPS)


def test_holomotion_s_keys(g1: RobotClip, tmp_path: Path) -> None:
    stored = np.load(g1.save(tmp_path / "clip.npz", format="holomotion"), allow_pickle=False)
    metadata = json.loads(str(stored["metadata"]))
    said = {"motion_fps": 50.0, "num_frames": FRAMES, "num_dofs": 29, "num_bodies": 30}
    assert said.items() <= metadata.items()
    assert metadata["wallclock_len"] == pytest.approx((FRAMES - 1) / FPS)
    shapes = {name: stored[name].shape[1:] for name in stored.files if name.startswith("ref_")}
    assert shapes == {
        "ref_dof_pos": (29,),
        "ref_dof_vel": (29,),
        "ref_global_translation": (30, 3),
        "ref_global_rotation_quat": (30, 4),
        "ref_global_velocity": (30, 3),
        "ref_global_angular_velocity": (30, 3),
    }
    assert all(stored[name].dtype == np.float32 for name in shapes)
    model, data = model_of(g1), mujoco.MjData(model_of(g1))
    t = 7
    # its checker: forward kinematics of the root and the joints gives the bodies
    data.qpos[:3] = stored["ref_global_translation"][t, 0]
    data.qpos[3:7] = stored["ref_global_rotation_quat"][t, 0][[3, 0, 1, 2]]
    data.qpos[7:] = stored["ref_dof_pos"][t]
    mujoco.mj_kinematics(model, data)
    np.testing.assert_allclose(stored["ref_global_translation"][t], data.xpos[1:31], atol=1e-5)


def test_older_holomotion_files_are_read(clip: RobotClip, tmp_path: Path) -> None:
    arrays = dict(np.load(clip.save(tmp_path / "clip.npz", format="holomotion")))
    old = {name.removeprefix("ref_"): values for name, values in arrays.items()}
    np.savez(tmp_path / "old.npz", **old)
    back = spark_sim.load(tmp_path / "old.npz", robot="robot")
    assert isinstance(back, RobotClip)
    np.testing.assert_allclose(back.qpos[:, 7:], clip.qpos[:, 7:], atol=1e-6)


def test_locomujoco_knows_every_key(g1: RobotClip, tmp_path: Path) -> None:
    stored = np.load(g1.save(tmp_path / "clip.npz", format="locomujoco"), allow_pickle=False)
    assert set(stored.files) <= {"joint_names", "frequency", "njnt", "jnt_type"} | {
        *("qpos", "qvel", "split_points")
    }
    assert stored["joint_names"].tolist() == ["root", *MOTORS_G1]
    assert (float(stored["frequency"]), int(stored["njnt"])) == (FPS, 30)
    assert stored["split_points"].tolist() == [0, FRAMES]
    assert stored["jnt_type"].tolist() == model_of(g1).jnt_type.tolist()
    np.testing.assert_allclose(stored["qpos"], g1.qpos, atol=1e-12)
    assert stored["qvel"].shape == (FRAMES, 35)


def test_locomujoco_s_own_files_are_read(clip: RobotClip, tmp_path: Path) -> None:
    """Several trajectories, an array of objects that is None, and joints in another order."""
    arrays = dict(np.load(clip.save(tmp_path / "clip.npz", format="locomujoco")))
    order = [*range(7), *(7 + np.arange(28, -1, -1))]
    arrays["qpos"] = np.concatenate([arrays["qpos"][:, order], np.zeros((5, 36))])
    arrays["joint_names"] = arrays["joint_names"][[0, *range(29, 0, -1)]]
    arrays |= {"split_points": np.array([0, FRAMES, FRAMES + 5])}
    np.savez(tmp_path / "theirs.npz", metadata=np.array(None, dtype=object), **arrays)
    back = spark_sim.load(tmp_path / "theirs.npz", robot="robot")
    assert isinstance(back, RobotClip)
    np.testing.assert_allclose(back.qpos[:, 7:], clip.qpos[:, 7:], atol=1e-9)
    assert "the first of 2 trajectories" in " ".join(back.notes)


def test_protomotions_states_are_tensors(g1: RobotClip, tmp_path: Path) -> None:
    path = g1.save(tmp_path / "clip.motion")
    stored = torch.load(path, weights_only=True)
    assert stored["fps"] == 50
    assert stored["rigid_body_contacts"].dtype == torch.bool
    assert stored["rigid_body_contacts"].shape == (FRAMES, 30)
    model, data = model_of(g1), mujoco.MjData(model_of(g1))
    t = 9
    data.qpos[:] = g1.qpos[t]
    mujoco.mj_kinematics(model, data)
    np.testing.assert_allclose(stored["rigid_body_pos"][t], data.xpos[1:31], atol=1e-6)
    world = Rotation.from_quat(stored["rigid_body_rot"][t].numpy())  # xyzw
    meant = Rotation.from_quat(data.xquat[1:31], scalar_first=True)
    assert (world * meant.inv()).magnitude().max() < 1e-5
    local = Rotation.from_quat(stored["local_rigid_body_rot"][t].numpy())
    above = model.body_parentid[2:31] - 1
    assert (world[above] * local[1:] * world[1:].inv()).magnitude().max() < 1e-5
    np.testing.assert_allclose(stored["dof_pos"], g1.qpos[:, 7:], atol=1e-6)


@pytest.mark.parametrize("format", FORMATS)
def test_contacts_are_labelled_where_there_is_room(
    format: str, g1: RobotClip, tmp_path: Path
) -> None:
    robot = g1.on_robot.robot
    qpos = np.repeat(robot.to_qpos(robot.tpose), FRAMES, axis=0)
    qpos[FRAMES // 2 :, 2] += np.linspace(0, 1.5, FRAMES - FRAMES // 2)  # lifted off the floor
    standing = RobotClip(RobotMotion(robot, robot.from_qpos(qpos), 1 / FPS), "standing")
    wanted = np.stack([*standing.contacts.values()], 1)
    assert wanted[0].all()
    assert not wanted[-1].any()
    path = standing.save(tmp_path / f"clip{FORMATS[format]}", format=format)
    if format == "locomujoco":  # it refuses keys that it doesn't know
        return
    if format == "protomotions":
        flags = torch.load(path, weights_only=True)["rigid_body_contacts"].numpy()
        names = [robot.mjcf.body_name(body) for body in robot.mjcf.bodies()]
        feet = [names.index(f"{side}_ankle_roll_link") for side in standing.contacts]
        np.testing.assert_array_equal(flags[:, feet], wanted)
        assert not np.delete(flags, feet, axis=1).any()
    elif FORMATS[format] == ".npz":
        stored = np.load(path)
        assert stored["foot_names"].tolist() == [*standing.contacts]
        np.testing.assert_array_equal(stored["foot_contacts"], wanted)
    else:
        beside = written_files(path, format)[-1]
        spans = json.loads(beside.read_text())["foot_contacts"]
        for k, side in enumerate(standing.contacts):
            frames = [t for first, last in spans[side] for t in range(first, last + 1)]
            assert frames == np.flatnonzero(wanted[:, k]).tolist()


@pytest.mark.parametrize("format", SIDECARS)
def test_what_a_file_does_not_say_stands_beside_it(
    format: str, clip: RobotClip, tmp_path: Path
) -> None:
    path = clip.save(tmp_path / f"clip{FORMATS[format]}", format=format)
    facts = json.loads((tmp_path / f"{path.name}.json").read_text())
    assert facts["fps"] == FPS
    assert facts["joint_names"] == list(clip.joint_names)
    back = spark_sim.load(path)  # nothing is told
    assert isinstance(back, RobotClip)
    turned = np.sign(np.sum(back.qpos[:, 3:7] * clip.qpos[:, 3:7], axis=1))
    read = back.qpos.copy()
    read[:, 3:7] *= turned[:, None]
    np.testing.assert_allclose(read, clip.qpos, atol=1e-6)
    assert back.fps == pytest.approx(FPS)
    assert str(tmp_path) not in json.dumps(facts)
    path.unlink()
    with pytest.raises(OutputError, match=r"\.json: exists"):
        clip.save(path, format=format)


def test_a_rate_that_is_not_the_files_is_questioned(clip: RobotClip, tmp_path: Path) -> None:
    path = clip.save(tmp_path / "clip.csv")
    fast = spark_sim.load(path, fps=2 * FPS)
    assert fast.fps == pytest.approx(2 * FPS)  # what the user says wins
    assert "2 times as fast as clip.csv.json says (50 fps)" in " ".join(fast.notes)
    other = spark_sim.load(path, quat="wxyz")
    assert "clip.csv.json says xyzw; is --quat right?" in " ".join(other.notes)
    path.write_text("\n".join(path.read_text().splitlines()[:12]))
    assert "has 12 frames, clip.csv.json says 30" in " ".join(spark_sim.load(path).notes)
    (tmp_path / "clip.csv.json").write_text("{")
    with pytest.raises(FileFormatError, match=r"clip\.csv\.json: all of it is no JSON"):
        spark_sim.load(path)


@pytest.mark.parametrize("format", FORMATS)
def test_spoilt_files_end_in_an_error_that_says_so(
    format: str, clip: RobotClip, tmp_path_factory: pytest.TempPathFactory
) -> None:
    """Bytes changed, cut out or repeated anywhere: a typed error, or a motion."""
    folder = tmp_path_factory.mktemp("fuzz")
    path = clip.save(folder / f"clip{FORMATS[format]}", format=format)
    files = written_files(path, format)
    whole = {file: file.read_bytes() for file in files}

    @settings(max_examples=30, deadline=None)
    @given(st.sampled_from(files), st.randoms(use_true_random=False))
    def spoil(file: Path, random: Random) -> None:
        data = bytearray(whole[file])
        at = random.randrange(len(data))
        match random.randrange(3):
            case 0:
                data[at] = random.randrange(256)
            case 1:
                del data[at : at + random.randrange(1, 400)]
            case _:
                data[at:at] = data[at // 2 : at // 2 + 60]
        file.write_bytes(bytes(data))
        try:
            spark_sim.load(path, robot="robot")
        except SparkSimError as error:
            assert str(folder) in str(error)  # noqa: PT017
        finally:
            file.write_bytes(whole[file])

    spoil()


def test_holosoma_s_keys(g1: RobotClip, tmp_path: Path) -> None:
    """What its trainer asks for; and with an object beside the robot, as its own files have."""
    path = g1.save(tmp_path / "clip.npz", format="holosoma")
    stored = dict(np.load(path, allow_pickle=False))
    names = stored["joint_names"].tolist()
    bodies = len(stored["body_names"])
    assert stored["joint_pos"].shape == (FRAMES, 7 + len(names))
    assert stored["joint_vel"].shape == (FRAMES, 6 + len(names))
    assert stored["body_pos_w"].shape == (FRAMES, bodies, 3)
    assert stored["body_ang_vel_w"].shape == (FRAMES, bodies, 3)
    np.testing.assert_allclose(stored["joint_pos"], g1.qpos, atol=1e-12)
    pelvis = stored["body_names"].tolist().index("pelvis")
    np.testing.assert_allclose(stored["body_pos_w"][:, pelvis], stored["joint_pos"][:, :3])
    stored["joint_names"] = np.array(names[::-1])
    stored["joint_pos"] = np.column_stack([g1.qpos[:, :7], g1.qpos[:, :6:-1]])
    stored["object_pos_w"] = np.zeros((FRAMES, 3))
    np.savez(tmp_path / "mixed.npz", **stored)
    back = spark_sim.load(tmp_path / "mixed.npz", robot="unitree_g1")
    assert isinstance(back, RobotClip)
    np.testing.assert_allclose(back.qpos, g1.qpos, atol=1e-9)
    assert "'object_pos_w'" in " ".join(back.notes)
