"""Long motions in blocks: the same as in one piece."""

from pathlib import Path

import numpy as np
import pytest

import spark_sim
from spark.blocks import blocks, in_blocks
from spark.motion import LazyMotion
from spark_sim import Clip, RobotClip
from spark_sim.choices import Method

IN_BLOCKS = ("spark.blocks.BLOCK", "spark.io.recording.BLOCK")


def test_every_frame_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("spark.blocks.BLOCK", 7)
    for count in (0, 1, 7, 8, 20):
        frames = np.arange(count)
        seen = [t for block in blocks(count) for t in frames[block]]
        assert seen == list(range(count))
        np.testing.assert_array_equal(in_blocks((2 * frames).__getitem__, count), 2 * frames)


@pytest.mark.parametrize("method", ["copy", "spark"])
@pytest.mark.parametrize("names", [("dancer_walk", "walker_wave"), ("walker_walk", "dancer_wave")])
def test_retargeting_in_blocks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, names: tuple[str, str], method: Method
) -> None:
    spark_sim.sample(tmp_path)
    files = [tmp_path / f"{name}.bvh" for name in names]
    whole = spark_sim.retarget(files[0], files[1], method=method)
    for name in IN_BLOCKS:
        monkeypatch.setattr(name, 7)
    assert isinstance(whole, Clip)
    parts = spark_sim.retarget(files[0], files[1], method=method)
    assert isinstance(parts, Clip)
    assert isinstance(parts.motion, LazyMotion)
    assert not isinstance(whole.motion, LazyMotion)
    assert parts.notes == whole.notes
    np.testing.assert_allclose(parts.recording.bvh.values, whole.recording.bvh.values, atol=1e-5)
    np.testing.assert_allclose(parts.motion.rotations, whole.motion.rotations, atol=1e-9)
    one, other = parts.save(tmp_path / "a.bvh"), whole.save(tmp_path / "b.bvh")
    assert len(one.read_bytes().splitlines()) == len(other.read_bytes().splitlines())


def test_a_robot_in_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Copied poses are the same to the bit; so are the file and the report's subject."""
    spark_sim.sample(tmp_path)
    walk = spark_sim.load(tmp_path / "walker_walk.bvh")
    whole = spark_sim.retarget(walk, "robot", method="copy")
    assert isinstance(whole, RobotClip)
    file = whole.save(tmp_path / "whole.npz")
    for name in IN_BLOCKS:
        monkeypatch.setattr(name, 7)
    walk = spark_sim.load(tmp_path / "walker_walk.bvh")
    parts = spark_sim.retarget(walk, "robot", method="copy")
    assert isinstance(parts, RobotClip)
    assert "_whole" not in vars(walk.motion), "nothing made all of it at once"
    assert isinstance(parts.motion, LazyMotion)
    assert not isinstance(whole.motion, LazyMotion)
    np.testing.assert_array_equal(parts.qpos, whole.qpos)
    for name in ("root_pos", "rotations", "translations"):
        np.testing.assert_array_equal(getattr(parts.motion, name), getattr(whole.motion, name))
    assert parts.save(tmp_path / "parts.npz").read_bytes() == file.read_bytes()
