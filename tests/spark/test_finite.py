"""Nothing that is no number is written."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import spark_sim
from spark.errors import OutputError
from spark.finite import check_output, first_not_finite
from spark.io.bvh import read_bvh, write_bvh
from spark_sim.clips import RobotClip


def test_the_first_bad_number_is_found_in_any_shape() -> None:
    rng = np.random.default_rng(0)
    for shape in ((), (3,), (5, 4), (7, 2, 3)):
        array = rng.normal(size=shape)
        assert first_not_finite(array) is None
        at = tuple(int(rng.integers(n)) for n in shape)
        array[at] = rng.choice([np.nan, np.inf, -np.inf])
        assert first_not_finite(array) == (at or (0,))
    assert first_not_finite(np.zeros((0, 3))) is None
    assert first_not_finite(np.arange(4)) is None
    long = np.zeros((3 << 20, 3), dtype=np.float32)
    long[-1, 2] = np.nan
    assert first_not_finite(long) == (len(long) - 1, 2)


def test_a_result_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"o\.bvh: not written: qpos 2 of frame 0 is nan"):
        check_output(tmp_path / "o.bvh", qpos=np.where(np.eye(3, 7, 2) > 0, np.nan, 0.0))


def test_no_writer_lets_one_out(tmp_path: Path) -> None:
    (walk, *_) = spark_sim.sample(tmp_path)
    bvh = read_bvh(walk)
    values = bvh.values.copy()
    values[3, 4] = np.inf
    for broken in (replace(bvh, values=values), replace(bvh, frame_time=np.nan)):
        with pytest.raises(OutputError, match="not written"):
            write_bvh(broken, tmp_path / "o.bvh")
    clip = spark_sim.load("robot")
    assert isinstance(clip, RobotClip)
    coordinates = clip.on_robot.coordinates  # the robot's own T-pose, which others read
    pos = coordinates.pos.copy()
    pos[0, 1] = np.nan
    motion = replace(clip.on_robot, coordinates=replace(coordinates, pos=pos))
    for name in ("o.npz", "o.csv", "o.pkl"):
        with pytest.raises(OutputError, match="not written: qpos 1 of frame 0 is nan"):
            RobotClip(motion, clip.name).save(tmp_path / name)
    assert not list(tmp_path.glob("o.*"))
