"""What a session records, whole and torn."""

import os
from pathlib import Path

import numpy as np
import pytest

import spark_sim
from spark.errors import FileFormatError, OutputError
from spark_sim.live.journal import Journal, recover


def journal(path: Path) -> tuple[Journal, spark_sim.RobotClip]:
    robot = spark_sim.load("robot")
    return Journal(path, robot, "robot", 1 / 50), robot


def test_steps_that_were_left_out_are_filled_in(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    made, robot = journal(path)
    for step in (3, 4, 6, 10):
        qpos = robot.qpos[0].copy()
        qpos[0] = 0.01 * step
        made.write(step, qpos)
    assert made.close() == path
    clip = spark_sim.load(path)
    assert isinstance(clip, spark_sim.RobotClip)
    np.testing.assert_allclose(clip.qpos[:, 0], 0.01 * np.arange(3, 11), atol=1e-9)
    assert clip.fps == pytest.approx(50)
    assert list(tmp_path.iterdir()) == [path]


def test_a_pause_is_not_filled(tmp_path: Path) -> None:
    made, robot = journal(tmp_path / "a.npz")
    for step in (0, 1, 10**12):
        made.write(step, robot.qpos[0])
    made.close()
    assert len(spark_sim.load(tmp_path / "a.npz")) == 602


@pytest.mark.parametrize("cut", [0, 1, 8, 100, 295])
def test_torn_at_any_byte_the_whole_steps_are_recovered(tmp_path: Path, cut: int) -> None:
    path = tmp_path / "a.npz"
    made, robot = journal(path)
    for step in range(5):
        made.write(step, robot.qpos[0])
    made._file.close()
    part = path.with_name("a.npz.part")
    content = part.read_bytes()
    part.write_bytes(content[: len(content) - cut])
    assert recover(part, force=False) == path
    assert len(spark_sim.load(path)) == (5 if cut == 0 else 4)


def test_pauses_without_end_are_not_filled(tmp_path: Path) -> None:
    made, robot = journal(tmp_path / "a.npz")
    for step in range(100):
        made.write(500 * step, robot.qpos[0])
    made.close()
    assert len(spark_sim.load(tmp_path / "a.npz")) == 100


def test_steps_that_go_back_are_left_out(tmp_path: Path) -> None:
    made, robot = journal(tmp_path / "a.npz")
    for step in (5, 3, 4, -(2**63), 2**63 - 1, 6):
        made.write(step, robot.qpos[0])
    made.close()
    assert len(spark_sim.load(tmp_path / "a.npz")) == 601  # 5, a pause, and the last one


def test_coordinates_of_another_robot_are_refused(tmp_path: Path) -> None:
    part = tmp_path / "a.npz.part"
    head = b'{"schema": "spark-sim live 1", "robot": "robot", "frame_time": 0.02, "nq": 9}\n'
    part.write_bytes(head + bytes(8 * 10 * 3) + np.arange(10.0).tobytes())
    with pytest.raises(FileFormatError, match="has 9 coordinates a step; robot has 36"):
        recover(part, force=False)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")
def test_a_pipe_is_not_waited_for(tmp_path: Path) -> None:
    part = tmp_path / "a.npz.part"
    os.mkfifo(part)
    with pytest.raises(FileFormatError, match="not a regular file"):
        recover(part, force=False)


def test_no_step_leaves_nothing(tmp_path: Path) -> None:
    made, _ = journal(tmp_path / "a.npz")
    assert made.close() is None
    assert list(tmp_path.iterdir()) == []


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    made, robot = journal(path)
    made.write(0, robot.qpos[0])
    made._file.close()
    with pytest.raises(OutputError, match="--recover"):
        journal(path)
    path.write_text("mine")
    with pytest.raises(OutputError, match="exists"):
        recover(path.with_name("a.npz.part"), force=False)
    assert path.read_text() == "mine"


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"\n",
        b"{}\n",
        b'{"schema": "spark-sim live 1", "robot": 3, "frame_time": 0.02, "nq": 36}\n',
        b'{"schema": "spark-sim live 1", "robot": "robot", "frame_time": 0, "nq": 36}\n',
        b'{"schema": "spark-sim live 1", "robot": "robot", "frame_time": 0.02, "nq": 1e99}\n',
        b"\xff" * 20_000,
        b"[" * 9_000 + b"\n",
    ],
)
def test_files_that_are_none(tmp_path: Path, content: bytes) -> None:
    part = tmp_path / "a.npz.part"
    part.write_bytes(content)
    with pytest.raises(FileFormatError, match="nothing that `spark-sim live` began"):
        recover(part, force=False)
    with pytest.raises(FileFormatError, match="no such file"):
        recover(tmp_path / "none.npz.part", force=False)


def test_a_full_disk_is_said_and_stops_nothing(tmp_path: Path) -> None:
    made, robot = journal(tmp_path / "a.npz")
    made.write(0, robot.qpos[0])
    made._file.close()
    made._file = open("/dev/full", "wb", buffering=0)  # noqa: SIM115
    made.write(1, robot.qpos[0])
    made.write(2, robot.qpos[0])
    assert "can't be written any more" in made.lost
    made.close()
    assert len(spark_sim.load(tmp_path / "a.npz")) == 1
