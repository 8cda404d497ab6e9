"""The report on robots: by the model's own shapes, masses and joints, against MuJoCo's answers."""

from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import mujoco
import numpy as np
import pytest
from jaxtyping import Float

import spark_sim
from robots import registry
from robots.formats.unitree import write_csv
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.model.understand import understand_robot
from robots.solver.solve import retarget
from sim.report import Report, Subject, assess
from sim.report.clip_poses import pose_clip
from sim.report.lowest import lowest_points
from sim.report.mass import model_mass
from sim.report.model_joints import model_limit_excess
from sim.report.model_poses import pose_model
from sim.report.wrench import required_wrench
from sim.trajectory import ModelTrajectory
from spark.errors import FileFormatError, SkeletonError, SparkSimError
from spark.io.recording import read_recording
from spark.rig.feet import sole_positions
from spark.rig.rig import understand
from spark.transfer.canonical import to_canonical
from spark_sim.cli import run
from spark_sim.clips import RobotClip
from tests.helpers.ember import changed_ember
from tests.helpers.recordings import recording

FPS, FRAMES = 60.0, 90
G = 9.81


@pytest.fixture(scope="module")
def robot() -> Morphology:
    return understand_robot(registry.find("robot"))


def standing(robot: Morphology, frames: int = FRAMES) -> Float[np.ndarray, "T nq"]:
    """The T-pose, its soles on z = 0."""
    qpos = np.tile(robot.to_qpos(robot.tpose)[0], (frames, 1))
    rig = robot.rig
    soles = [sole_positions(sole, rig.tpose_positions, rig.tpose) for sole in rig.soles]
    lowest = np.concatenate(soles)[:, 2].min()
    qpos[:, 2] += -lowest - robot.motion(robot.from_qpos(qpos[:1]), 1.0).root_pos[0, 2]
    return qpos


def moving(robot: Morphology, qpos: Float[np.ndarray, "T nq"], fps: float = FPS) -> RobotMotion:
    return RobotMotion(robot, robot.from_qpos(qpos), 1 / fps)


def judged(on_robot: RobotMotion) -> Report:
    return assess(Subject(on_robot.motion, on_robot.robot.rig, on_robot.body))


def column(robot: Morphology, joint: str) -> int:
    """Where a joint's coordinate is in qpos."""
    return int(robot.mjcf.model.joint(joint).qposadr[0])


def with_floor(body: ModelTrajectory, height: float) -> tuple[mujoco.MjModel, int]:
    """The body over a plane, and the plane's number."""
    spec = body.spec.copy()
    plane = mujoco.mjtGeom.mjGEOM_PLANE
    floor = spec.worldbody.add_geom(type=plane, size=[9, 9, 1], pos=[0, 0, height], name="under")
    model = spec.compile()
    return model, int(model.geom(floor.name).id)


@pytest.mark.parametrize(
    "name",
    ["robot", "unitree_g1", "unitree_h1", "booster_t1", "berkeley_humanoid", "gymnasium_humanoid"],
)
def test_every_robot_stands_with_its_soles_on_the_floor(name: str) -> None:
    try:
        robot = understand_robot(registry.find(name))
    except SparkSimError as error:
        pytest.skip(f"{name}: {error}")
    still = moving(robot, standing(robot, 30))
    report = judged(still)
    assert report.clip.limit_share == 0
    assert report.clip.self_penetration.sum() == 0
    assert report.implausible == 0, report.text()
    poses = pose_clip(Subject(still.motion, robot.rig, still.body))
    np.testing.assert_allclose(poses.corners[..., 2], 0, atol=3e-3)
    model, floor = with_floor(still.body, 0.02)
    names = [robot.rig.skeleton.names[j] for sole in robot.soles for j in sole.joints]
    feet = {int(model.body_weldid[model.body(name).id]) for name in names}
    data = mujoco.MjData(model)
    data.qpos[:] = still.body.qpos[0]
    mujoco.mj_forward(model, data)
    gaps = [
        mujoco.mj_geomDistance(model, data, floor, g, 1.0, None)
        for g in range(model.ngeom)
        if int(model.body_weldid[model.geom_bodyid[g]]) in feet
        and model.geom_contype[g] | model.geom_conaffinity[g]
        and g != floor
    ]
    if gaps:
        assert min(gaps) == pytest.approx(-0.02, abs=3e-3)


def test_lifted_sunk_and_slid_robots_are_told_without_a_source(robot: Morphology) -> None:
    for axis, path, flag in (
        (2, 0.05, "floating"),
        (2, -0.02, "penetration"),
        (0, 0.4 * np.arange(FRAMES) / FPS, "skating"),
    ):
        qpos = standing(robot)
        qpos[:, axis] += path
        assert judged(moving(robot, qpos)).clip.shares[flag] == 1


def test_the_floor_of_a_robot_is_at_zero_whatever_its_source_s_is(robot: Morphology) -> None:
    still = moving(robot, standing(robot))
    raised = replace(still.motion, root_pos=still.motion.root_pos + np.array([0, 0, 0.03]))
    report = assess(Subject(still.motion, robot.rig, still.body), source=Subject(raised, robot.rig))
    assert report.clip.floor_z == 0
    assert report.implausible == 0
    up = standing(robot)
    up[:, 2] += 0.02
    assert any("2.0 cm above" in note for note in judged(moving(robot, up)).notes)


def test_required_wrench_is_the_root_of_mujocos_inverse_dynamics(robot: Morphology) -> None:
    rng, dt, frames = np.random.default_rng(5), 1e-3, 80
    times = np.arange(frames)[:, None] * dt
    qpos = standing(robot, frames)
    waves = np.sin(times * rng.uniform(3, 9, qpos.shape[1]) + rng.uniform(0, 6, qpos.shape[1]))
    qpos[:, :3] += 0.2 * waves[:, :3]
    qpos[:, 3:7] += 0.2 * waves[:, 3:7]
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    qpos[:, 7:] += 0.3 * waves[:, 7:]
    body = moving(robot, qpos, 1 / dt).body
    ours = required_wrench(model_mass(body, pose_model(body)), dt, 0.004)

    model = body.model
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    data = mujoco.MjData(model)
    velocity = np.zeros((frames, model.nv))
    for t in range(frames - 1):
        mujoco.mj_differentiatePos(model, velocity[t], dt, qpos[t], qpos[t + 1])
    weight = model.body_mass.sum() * G
    root = body.root
    for t in range(20, 60, 5):
        data.qpos[:] = qpos[t]
        data.qvel[:] = 0.5 * (velocity[t - 1] + velocity[t])
        data.qacc[:] = (velocity[t] - velocity[t - 1]) / dt
        mujoco.mj_inverse(model, data)
        force = data.qfrc_inverse[:3]
        turn, arm = data.xmat[root].reshape(3, 3), data.xpos[root] - data.subtree_com[root]
        torque = turn @ data.qfrc_inverse[3:6] + np.cross(arm, force)
        np.testing.assert_allclose(ours[t, :3], force / weight, atol=0.01)
        np.testing.assert_allclose(ours[t, 3:], torque / weight, atol=0.005)


def test_a_hinge_beyond_its_range_is_named_with_the_excess(robot: Morphology) -> None:
    high = robot.mjcf.model.joint("left_knee").range[1]
    qpos = standing(robot, 60)
    qpos[20:40, column(robot, "left_knee")] = high + np.radians(10)
    qpos[40:50, column(robot, "left_knee")] = high - np.radians(1.9)
    qpos[50:55, column(robot, "left_knee")] = high - np.radians(2.1)
    report = judged(moving(robot, qpos))
    found = report.json()["clip"]["joint_limits"]
    knee = found.pop("left_knee")
    assert knee["share"] == pytest.approx(20 / 60)
    assert knee["at_limit_share"] == pytest.approx(30 / 60)
    assert np.degrees(knee["largest_excess_rad"]) == pytest.approx(10, abs=0.02)
    assert all(joint["share"] == 0 for joint in found.values())
    assert report.clip.limit_share == pytest.approx(20 / 60)
    bent = [f for f in report.findings if f.measure == "joint_limit"]
    assert [(f.where, f.start, f.stop) for f in bent] == [("left_knee", 20, 40)]
    assert "10° beyond its limit" in bent[0].sentence


def test_a_hinge_of_little_range_is_at_its_limit_within_a_twentieth_of_it() -> None:
    """Of 20 degrees: within 1."""
    spec = mujoco.MjSpec.from_string(
        """<mujoco><worldbody><body name="base"><freejoint/><geom size=".1"/>
        <body name="toe"><joint name="toe" range="-10 10"/><geom size=".1"/></body>
        </body></worldbody></mujoco>"""
    )
    model = spec.compile()
    qpos = np.zeros((4, 8))
    qpos[:, 3], qpos[:, 7] = 1.0, np.radians([8.9, 9.1, -9.1, -8.9])
    (toe,) = model_limit_excess(ModelTrajectory(spec, model, 1, qpos))
    assert toe.at_limit.tolist() == [False, True, True, False]


def test_speed_and_jerk_are_those_of_the_hinges(robot: Morphology) -> None:
    # angle = 0.5 sin 6t: speed 3 |cos 6t|, jerk 108 |cos 6t|; the window damps each by a percent.
    qpos = standing(robot, 240)
    times = np.arange(240) / FPS
    qpos[:, column(robot, "left_elbow")] += 0.5 * np.sin(6 * times)
    clip = judged(moving(robot, qpos)).clip
    elbow = clip.joint_names.index("left_elbow")
    inside, cosine = slice(24, -24), np.abs(np.cos(6 * times))[24:-24]
    np.testing.assert_allclose(clip.joint_speed[inside, elbow], 3 * cosine, atol=0.06)
    np.testing.assert_allclose(clip.joint_jerk[inside, elbow], 108 * cosine, atol=4)
    others = [k for k in range(len(clip.joint_names)) if k != elbow]
    assert clip.joint_speed[:, others].max() < 1e-9


def test_parts_that_go_into_each_other_are_named_with_mujocos_depth(robot: Morphology) -> None:
    qpos = standing(robot, 3)
    # Arms that hang from a T-pose the wrong way round cross the trunk: the legs cross instead.
    for side, way in (("left", -0.35), ("right", 0.35)):
        qpos[1, column(robot, f"{side}_hip_roll")] += way
    on_robot = moving(robot, qpos)
    clip = judged(on_robot).clip
    assert clip.self_penetration.tolist() == [False, True, False]
    model, data = on_robot.body.model, mujoco.MjData(on_robot.body.model)
    data.qpos[:] = qpos[1]
    mujoco.mj_forward(model, data)
    for (one, other), depth in zip(clip.self_pairs, clip.self_depth[1], strict=True):
        bodies = [model.body(name.replace(" ", "_")).id for name in (one, other)]
        geoms = [
            [g for g in range(model.ngeom) if model.geom_bodyid[g] == b and model.geom_contype[g]]
            for b in bodies
        ]
        gap = min(
            mujoco.mj_geomDistance(model, data, a, b, 1.0, None) for a in geoms[0] for b in geoms[1]
        )
        assert depth == pytest.approx(-gap, abs=1e-3)


SHAPES = """<mujoco><asset><mesh name="m" vertex="0 0 0 .3 0 0 0 .2 0 0 0 .4 .1 .1 -.1"/></asset>
<worldbody><body name="b" pos="0 0 1"><freejoint/>
<geom type="{type}" size="{size}" pos=".1 -.2 .05" euler="20 50 70" {mesh}/></body></worldbody>
</mujoco>"""


@pytest.mark.parametrize(
    ("kind", "size"),
    [
        ("sphere", ".1"),
        ("capsule", ".05 .2"),
        ("ellipsoid", ".05 .08 .1"),
        ("cylinder", ".1 .2"),
        ("box", ".1 .2 .3"),
        ("mesh", ".1"),
    ],
)
def test_lowest_points_are_mujocos_distance_from_a_plane(kind: str, size: str) -> None:
    mesh = 'mesh="m"' if kind == "mesh" else ""
    spec = mujoco.MjSpec.from_string(SHAPES.format(type=kind, size=size, mesh=mesh))
    rng = np.random.default_rng(7)
    quats = rng.normal(size=(20, 4))
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    qpos = np.concatenate([rng.normal(size=(20, 3)) + np.array([0, 0, 3]), quats], axis=1)
    body = ModelTrajectory(spec, spec.compile(), 1, qpos)
    names, lowest, _ = lowest_points(body, pose_model(body), {})
    assert names == ("b",)
    model, floor = with_floor(body, -5.0)
    data = mujoco.MjData(model)
    for t in range(20):
        data.qpos[:] = qpos[t]
        mujoco.mj_forward(model, data)
        gap = mujoco.mj_geomDistance(model, data, floor, 1 - floor, 50.0, None)
        assert lowest[t, 0, 2] == pytest.approx(gap - 5, abs=3e-3)


def test_a_body_with_other_frames_is_refused(robot: Morphology) -> None:
    still = moving(robot, standing(robot, 4))
    with pytest.raises(SkeletonError, match="4 frames, the motion 3"):
        assess(Subject(still.motion.frames(0, 3), robot.rig, still.body))


def test_a_walk_put_on_a_robot_is_plausible_and_a_worse_one_is_told(robot: Morphology) -> None:
    motion = read_recording(recording("cmu_asf/cmu_02_05.bvh")).motion.frames(0, 200)
    rig = understand(motion)
    on_robot = retarget(to_canonical(motion, rig), robot)
    source = Subject(motion, rig)
    report = assess(Subject(on_robot.motion, robot.rig, on_robot.body), source=source)
    assert report.implausible < 0.05, report.text()
    assert report.clip.limit_share == 0
    assert report.drift is not None
    assert report.drift.distance.max() < 0.15
    sunk = on_robot.qpos - np.eye(on_robot.qpos.shape[1])[2] * 0.03
    worse = moving(robot, sunk, motion.fps)
    assert assess(Subject(worse.motion, robot.rig, worse.body), source=source).implausible > 0.9


def on_command_line(*args: str) -> tuple[int, list[str]]:
    """Exit code, and the lines of stdout, of one command."""
    with TemporaryFile("w+") as out, TemporaryFile("w+") as err:
        with redirect_stdout(out), redirect_stderr(err):
            code = run(args)
        out.seek(0)
        return code, out.read().splitlines()


def test_results_of_other_tools_are_judged_and_compared(robot: Morphology, tmp_path: Path) -> None:
    def written(name: str, change: Callable[[Float[np.ndarray, "T nq"]], None]) -> str:
        qpos = standing(robot, 30)
        change(qpos)
        write_csv(moving(robot, qpos), tmp_path / name, quat="xyzw")
        return str(tmp_path / name)

    def nothing(qpos: Float[np.ndarray, "T nq"]) -> None:
        pass

    def lift(qpos: Float[np.ndarray, "T nq"]) -> None:
        qpos[:, 2] += 0.05

    good, lifted = written("good.csv", nothing), written("lifted.csv", lift)
    of_robot = ["--robot", "robot", "--quat", "xyzw", "--fps", "60"]
    code, lines = on_command_line("report", lifted, "--compare", good, "--truth", good, *of_robot)
    assert code == 0
    rows = {line[:34].strip(): line[34:].split() for line in lines[1:]}
    assert lines[0].split() == ["lifted", "good"]
    assert rows["floating [%]"] == ["100.0", "0.0*"]
    assert rows["ground-truth MSE [1e-4]"][1] == "0.00*"
    assert on_command_line("report", good, *of_robot, "--fail-over", "1%")[0] == 0
    assert on_command_line("report", lifted, *of_robot, "--fail-over", "1%")[0] == 1


def test_qpos_of_any_script_is_read(robot: Morphology, tmp_path: Path) -> None:
    qpos = standing(robot, 30)
    rates: tuple[dict[str, Any], ...] = ({"fps": 50}, {"dt": 0.02}, {"frame_time": [0.02]})
    for k, rate in enumerate(rates):
        path = tmp_path / f"{k}.npz"
        np.savez(path, qpos=qpos, **rate)
        clip = spark_sim.load(path, robot="robot")
        assert isinstance(clip, RobotClip)
        assert clip.motion.frame_time == pytest.approx(0.02)
        np.testing.assert_allclose(clip.body.qpos, qpos, atol=1e-12)
        assert spark_sim.report(clip).implausible == 0


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"fps": 0}, "fps is 0"),
        ({"fps": 50, "dt": 0.01}, "tells two rates: 'dt' is 0.01, .* says 50 fps; leave the wrong"),
        ({"dt": 0}, "the frame time is 0 s"),
        ({}, "doesn't say its rate; expected 'fps'"),
        ({"fps": 50, "qpos": np.zeros((3, 40))}, "40 columns; the robot 'ember' has 36"),
        ({"fps": 50, "qpos": np.zeros((3, 36))}, "length 0; expected 1"),
        ({"fps": 50, "qpos": np.full((3, 36), np.nan)}, "is nan in frame 0"),
        ({"fps": 50, "qpos": np.zeros(36)}, "expected any x any"),
    ],
)
def test_qpos_that_is_broken_is_refused(
    robot: Morphology, tmp_path: Path, wrong: dict[str, object], message: str
) -> None:
    path = tmp_path / "broken.npz"
    arrays: dict[str, Any] = {"qpos": standing(robot, 3)} | wrong
    np.savez(path, **arrays)
    with pytest.raises(FileFormatError, match=message):
        spark_sim.load(path, robot="robot")


@pytest.mark.parametrize(
    ("pair", "said"),
    [(None, False), ("", True), ('<pair geom1="head" geom2="pelvis"/>', False)],
    ids=["as it is", "floor alone", "a pair"],
)
def test_who_may_touch_the_floor_alone_is_not_said_to_be_out_of_itself(
    robot: Morphology, tmp_path: Path, pair: str | None, said: bool
) -> None:
    """But who has a pair of shapes that may touch each other is not among them."""
    if pair is not None:
        changes = {
            '<geom group="3"': '<geom conaffinity="0" group="3"',
            ' mass="3.6"': ' mass="3.6" name="pelvis"',
            "<contact>": f"<contact>{pair}",
        }
        robot = changed_ember(tmp_path, "|".join(changes), lambda found: changes[found[0]])
    still = moving(robot, standing(robot, 3))
    report = assess(Subject(still.motion, robot.rig, still.body))
    assert any("self-penetration is not measured" in note for note in report.notes) is said
