"""TRC: points as they were written, and joints where the body that moved has them."""

from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import spark_sim
from spark.errors import FileFormatError, SparkSimError
from spark.io.trc_file import read_trc_points
from spark.kinematics import forward
from spark_sim import Clip
from tests.helpers.trc import HALPE, trc_text


def places_of(clip: Clip) -> np.ndarray:
    """Where the joints are [m] that HALPE names, Z up."""
    positions, _ = forward(clip.motion)
    return np.stack([positions[:, clip.rig.roles.require(role)] for role in HALPE.values()], axis=1)


def test_points_are_read_as_they_were_written(tmp_path: Path) -> None:
    points = np.random.default_rng(0).uniform(-2, 2, (7, 3, 3)).round(5)
    points[2, 1] = np.nan
    points[3, 2] = np.nan  # the last of its row: some writers leave out the tabs behind
    (tmp_path / "a.trc").write_text(trc_text(["A", "long name", "C"], points, rate=59.94))
    read = read_trc_points(tmp_path / "a.trc")
    assert (read.labels, read.rate, read.unit) == (("A", "long name", "C"), 59.94, "m")
    np.testing.assert_array_equal(read.values, points)
    assert read.notes == ()


@pytest.mark.parametrize(("unit", "metres"), [("m", 1.0), ("mm", 0.001)])
def test_joint_centres_become_joints(unit: str, metres: float, walk: Clip, tmp_path: Path) -> None:
    """Each within 2 % of the body's height: Y is up, as in OpenSim."""
    there = places_of(walk)
    points = there[..., [1, 2, 0]] / metres
    points[4:7, 3] = np.nan
    path = tmp_path / "walk.trc"
    path.write_text(trc_text(list(HALPE), points, rate=walk.fps, unit=unit))
    clip = spark_sim.load(path)
    assert isinstance(clip, Clip)
    assert clip.recording.convention.up == "y"
    assert clip.fps == pytest.approx(walk.fps)
    assert np.linalg.norm(places_of(clip) - there, axis=-1).max() < 0.02 * 1.7
    assert any("3 positions are missing" in note for note in clip.notes)
    moved = spark_sim.retarget(clip, walk)
    assert len(moved) == len(walk)


def test_rows_that_are_missing_are_said(tmp_path: Path) -> None:
    text = trc_text(["A"], np.zeros((4, 1, 3)))
    (tmp_path / "a.trc").write_text(text.rpartition("4\t")[0])
    read = read_trc_points(tmp_path / "a.trc")
    assert len(read.values) == 3
    assert read.notes == ("NumFrames says 4, but 3 rows follow: those are read",)


BROKEN = {
    ":1: is no TRC file": lambda text: text[4:],
    ":4: names no points": lambda text: text.replace("A\t\t\tB", ""),
    ": has no frames of its 2 points": lambda text: "\n".join(text.splitlines()[:5]),
    ":7: has 9 numbers; expected 6": lambda text: text.replace("\n1\t", "\n1\t0\t1\t1\t", 1),
    ":8: expected numbers": lambda text: text.replace("\n2\t0.03333\t0.5", "\n2\t0\tx", 1),
    ":7: holds numbers beyond": lambda text: text.replace("0.50000", "1e300", 1),
}


@pytest.mark.parametrize("message", BROKEN)
def test_broken_files_say_where(message: str, tmp_path: Path) -> None:
    text = BROKEN[message](trc_text(["A", "B"], np.full((3, 2, 3), 0.5)))
    (tmp_path / "a.trc").write_text(text)
    with pytest.raises(FileFormatError, match=rf"a\.trc{message}"):
        read_trc_points(tmp_path / "a.trc")


@settings(max_examples=60, deadline=None)
@given(at=st.integers(0, 10_000), what=st.text(min_size=1, max_size=4))
def test_spoilt_files_end_in_a_typed_error(
    at: int, what: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    points = np.random.default_rng(1).uniform(-1, 1, (4, len(HALPE), 3))
    text = trc_text(list(HALPE), points)
    path = tmp_path_factory.mktemp("spoilt") / "a.trc"
    path.write_text(text[: at % len(text)] + what + text[at % len(text) + 1 :], "utf-8", "ignore")
    with suppress(SparkSimError):
        spark_sim.load(path)
