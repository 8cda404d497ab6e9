"""What a robot's motion was made from, as each format with room for it says."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

import spark_sim
from robots.formats import FORMATS
from robots.formats.made_from import MadeFrom, made_from
from spark_sim.clips import AnyClip, RobotClip

SAYING = ("npz", "csv", "csv-wxyz", "bones-seed", "gmr", "sonic")


def on_robot(source: AnyClip) -> RobotClip:
    made = spark_sim.retarget(source.resampled(50.0), "robot", method="copy")
    assert isinstance(made, RobotClip)
    return made


@pytest.mark.parametrize("format", SAYING)
def test_a_motion_says_which_part_of_which_file_it_is(
    format: str, walk_path: Path, tmp_path: Path
) -> None:
    sha256 = hashlib.sha256(walk_path.read_bytes()).hexdigest()
    out = tmp_path / f"walk{FORMATS[format]}"
    on_robot(spark_sim.load(walk_path).part(0.5, 1.0)).save(out, format=format)
    found = made_from(out)
    assert found is not None
    assert (found.name, found.sha256) == (walk_path.name, sha256)
    assert found.part == pytest.approx((0.5, 1.0), abs=0.01)
    assert found.is_of(walk_path)
    assert not found.is_of(out / "joint_pos.csv" if out.is_dir() else out)


def test_all_of_a_file_is_no_part(walk_path: Path, tmp_path: Path) -> None:
    clip = spark_sim.load(walk_path)
    assert clip.part(0.0, 99.0).span is None
    on_robot(clip).save(tmp_path / "walk.npz")
    assert made_from(tmp_path / "walk.npz") == MadeFrom(
        walk_path.name, hashlib.sha256(walk_path.read_bytes()).hexdigest()
    )


def test_a_part_of_a_part_is_told_in_the_file_s_own_time(walk_path: Path) -> None:
    clip = spark_sim.load(walk_path)
    dt = clip.frame_time
    part = clip.part(10 * dt, 60 * dt).resampled(50.0).part(0.2, 0.4)
    assert part.span == pytest.approx((10 * dt + 0.2, 10 * dt + 0.4))
    made = on_robot(part).part(0.1)
    assert made.span == pytest.approx((10 * dt + 0.3, 10 * dt + 0.4))


@pytest.mark.parametrize("part", [None, [1.0], [2.0, 1.0], [-1.0, 1.0], ["0", "1"], "0 to 1"])
def test_a_part_that_is_none_counts_as_none(part: object, tmp_path: Path) -> None:
    facts = {"source": "a.bvh", "source_sha256": "00", "source_part_s": part}
    np.savez(tmp_path / "a.npz", about=np.array(json.dumps(facts)))
    assert made_from(tmp_path / "a.npz") == MadeFrom("a.bvh", "00")


@pytest.mark.parametrize("about", ["no json", "[]", "{}", '{"source": 1, "source_sha256": 2}'])
def test_a_file_that_says_nothing_is_made_from_nothing(about: str, tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", about=np.array(about))
    (tmp_path / "b.npz").write_bytes(b"no archive")
    (tmp_path / "c.csv").write_text("1,2,3")
    assert {made_from(tmp_path / name) for name in ("a.npz", "b.npz", "c.csv", "d.npz")} == {None}
