"""Walks in place: on a belt under a character, and over the ground in simulation."""

from pathlib import Path

import numpy as np
import pytest

import spark_sim
from sim.report import Subject, assess
from spark.demo import gait
from spark.demo.sample import sample_motion, sample_rig
from spark.io.bvh import write_bvh
from spark.io.encoding import encode_new
from spark_sim.clips import Clip
from spark_sim.describe import describe

WALK = sample_motion("walk", sample_rig("walker"), 30.0)
AHEAD = WALK.root_pos[-1] - WALK.root_pos[0]
WAY = np.linspace(0, 1, len(WALK))[:, None] * AHEAD * [1.0, 1.0, 0.0]


@pytest.fixture(scope="module")
def in_place(tmp_path_factory: pytest.TempPathFactory) -> Clip:
    path = tmp_path_factory.mktemp("walk") / "in_place.bvh"
    write_bvh(encode_new(WALK.moved(-WAY)), path)
    clip = spark_sim.load(path)
    assert isinstance(clip, Clip)
    return clip


def test_on_a_character_it_stays_in_place_and_stands_on_a_belt(
    in_place: Clip, tmp_path: Path
) -> None:
    small = tmp_path / "dancer.bvh"
    write_bvh(encode_new(sample_motion("squat", sample_rig("dancer"), 30.0)), small)
    out = spark_sim.retarget(in_place, small)
    (note,) = [note for note in out.notes if "in place" in note]
    pace = float(note.split("which goes at ")[1].split()[0])
    assert np.ptp(out.motion.root_pos[:, 0]) < 0.1
    belt = pace * np.outer(np.arange(len(WALK)) / 30.0, AHEAD / np.linalg.norm(AHEAD))
    travelling = Subject(out.motion.moved(belt), out.rig)
    report = assess(travelling, source=Subject(WALK, in_place.rig))
    assert report.contacts is not None
    assert report.contacts.f1 is not None
    assert report.contacts.f1 > 0.95
    assert report.clip.flags["skating"].mean() < 0.05


def test_of_a_loop_inspect_tells_the_speed_that_retarget_does(tmp_path: Path) -> None:
    """Both see it as it goes on; a stride alone is a little faster."""
    rig = sample_rig("walker")
    stride = WALK.frames(20, 21 + round(30 * gait.stride_time(rig)))
    pinned = stride.moved((stride.root_pos[:1] - stride.root_pos) * [1.0, 1.0, 0.0])
    write_bvh(encode_new(pinned), tmp_path / "stride.bvh")
    clip = spark_sim.load(tmp_path / "stride.bvh")
    facts, notes = describe(clip), spark_sim.retarget(clip, clip).notes
    assert facts["loop"]
    assert any(f"treadmill at {facts['treadmill_m_s']:.2f} m/s:" in note for note in notes)


def test_in_simulation_it_goes_over_the_ground(in_place: Clip) -> None:
    seen = spark_sim.simulate(in_place, assist=True)
    went = seen.tracked.target.qpos[-1, :2] - seen.tracked.target.qpos[0, :2]
    np.testing.assert_allclose(went, AHEAD[:2], atol=0.15)
    assert any("walks in place" in note for note in seen.notes)
