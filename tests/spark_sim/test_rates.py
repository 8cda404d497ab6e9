"""Parts of clips, and clips at other rates."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

import spark_sim
from spark.errors import ConventionError
from spark.rotation import quat_angle
from spark_sim.clips import Clip, RobotClip
from tests.helpers.program import Program


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("rates")
    spark_sim.sample(made)
    return made


@pytest.fixture(scope="module")
def walk(folder: Path) -> Clip:
    clip = spark_sim.load(folder / "walker_walk.bvh")
    assert isinstance(clip, Clip)
    return clip


@pytest.fixture(scope="module")
def program(folder: Path) -> Iterator[Program]:
    with Program(folder) as running:
        yield running


def test_rotations_are_resampled_on_the_sphere(walk: Clip) -> None:
    fast = walk.resampled(50.0)
    assert fast.fps == pytest.approx(50)
    assert walk.duration - 0.02 < fast.duration <= walk.duration + 1e-9
    times = np.arange(len(fast)) / 50
    own = np.arange(len(walk)) * walk.frame_time
    for j in (0, 3, 9):
        slerp = Slerp(own, Rotation.from_quat(walk.motion.rotations[:, j], scalar_first=True))
        expected = slerp(times).as_quat(scalar_first=True)
        assert quat_angle(fast.motion.rotations[:, j], expected).max() < 1e-6
    for axis in range(3):
        expected = np.interp(times, own, walk.motion.root_pos[:, axis])
        np.testing.assert_allclose(fast.motion.root_pos[:, axis], expected, atol=1e-9)


def test_whole_frames_stay_as_they_are(walk: Clip) -> None:
    half = walk.resampled(walk.fps / 2)
    np.testing.assert_array_equal(half.motion.rotations, walk.motion.rotations[::2])
    assert walk.resampled(walk.fps) is walk


def test_a_part_is_its_frames(walk: Clip, tmp_path: Path) -> None:
    part = walk.part(0.5, 1.2)
    first, last = round(0.5 * walk.fps), int(1.2 * walk.fps + 0.01)
    np.testing.assert_array_equal(part.motion.root_pos, walk.motion.root_pos[first : last + 1])
    assert len(walk.part(end=999.0)) == len(walk)
    assert len(walk.part(walk.duration)) == 1
    read = spark_sim.load(part.resampled(50.0).save(tmp_path / "part.bvh"))
    assert read.fps == pytest.approx(50, rel=1e-4)
    np.testing.assert_allclose(
        read.motion.root_pos, part.resampled(50.0).motion.root_pos, atol=1e-5
    )


@pytest.mark.parametrize(
    ("start", "end"),
    [(-1.0, None), (99.0, None), (1.0, 0.5), (float("nan"), None), (float("inf"), None)],
)
def test_a_part_that_is_not_there(start: float, end: float | None, walk: Clip) -> None:
    with pytest.raises(ConventionError, match=r"walker_walk: there is nothing from .* runs from 0"):
        walk.part(start, end)


@pytest.mark.parametrize("fps", [0.0, -1.0, float("nan"), float("inf"), 1e9])
def test_a_rate_is_a_positive_number(fps: float, walk: Clip) -> None:
    with pytest.raises(ConventionError, match="expected a number above 0"):
        walk.resampled(fps)


def test_a_robot_s_clip(folder: Path, walk: Clip) -> None:
    robot = spark_sim.retarget(walk, "robot", method="copy")
    fast = robot.resampled(50.0)
    times = np.arange(len(fast)) / 50
    own = np.arange(len(robot)) * robot.frame_time
    expected = np.interp(times, own, robot.qpos[:, 12])
    np.testing.assert_allclose(fast.qpos[:, 12], expected, atol=1e-9)
    slerp = Slerp(own, Rotation.from_quat(robot.qpos[:, 3:7], scalar_first=True))
    turned = slerp(times).as_quat(scalar_first=True)
    assert quat_angle(fast.qpos[:, 3:7], turned).max() < 1e-6
    np.testing.assert_allclose(robot.part(0.5, 1.0).qpos[0], robot.qpos[15], atol=1e-12)


def test_the_command_line_cuts_and_resamples(program: Program, folder: Path) -> None:
    cut = ("--fps", "50", "--start", "0.4", "--end", "1.4", "--method", "copy")
    done = program("retarget", "walker_walk.bvh", "--to", "dancer_walk.bvh", *cut, "--json")
    assert done.code == 0, done.stderr
    said = json.loads(done.stdout)
    assert (said["frames"], round(said["fps"], 3)) == (51, 50)
    for name, out in (("sonic", "takes/"), ("beyondmimic", "b.npz"), ("bones-seed", "b.csv")):
        done = program(
            *("retarget", "walker_walk.bvh", "--to", "robot", "--format", name, "-o", out), *cut
        )
        assert done.code == 0, done.stderr
        assert "51 frames, 50 fps" in done.stdout
    assert (folder / "takes" / "walker_walk_on_robot" / "metadata.txt").is_file()
    assert program("inspect", "takes/walker_walk_on_robot").code == 0
    back = program("retarget", "takes/walker_walk_on_robot", "--to", "dancer_walk.bvh")
    assert "walker_walk_on_robot_on_dancer_walk.bvh: 51 frames, 50 fps" in back.stdout, back.stderr
    assert program("retarget", "b.csv", "--to", "dancer_walk.bvh", "-o", "c.bvh").code == 0
    refused = program(
        *("retarget", "walker_walk.bvh", "--to", "robot", "--start", "9", "-o", "late.npz")
    )
    assert refused.code == 2
    assert "there is nothing from 9 to" in refused.stderr


def test_a_csv_at_the_wrong_rate_is_questioned(program: Program, folder: Path, walk: Clip) -> None:
    robot = spark_sim.retarget(walk, "robot", method="copy")
    assert isinstance(robot, RobotClip)
    robot.save(folder / "w.csv")
    (folder / "w.csv.json").unlink()
    told = ("w.csv", "--robot", "robot", "--quat", "xyzw")
    done = program("report", *told, "--fps", "60", "--source", "walker_walk.bvh")
    assert "Is its rate 30 fps, and not 60?" in " ".join(done.stdout.split())
    done = program("report", *told, "--fps", "30", "--source", "walker_walk.bvh")
    assert "Is its rate" not in done.stdout
    onto = ("--to", "dancer_walk.bvh")
    done = program("retarget", *told, *onto, "-o", "x.bvh")
    assert done.code == 2
    assert "its frame rate" in done.stderr
    done = program("retarget", *told, *onto, "--fps", "30", "-o", "x.bvh")
    assert "read at 30 fps, as --fps says; --source-fps" in done.stderr
    done = program("retarget", *told, *onto, "--source-fps", "30", "--fps", "15", "-o", "y.bvh")
    assert f"{(len(walk) + 1) // 2} frames, 15 fps" in done.stdout, done.stderr
