"""What a report says of a walk in place, and what it compares with one."""

import numpy as np
import pytest

from sim.report import Subject, assess
from spark.demo.sample import sample_motion, sample_rig
from spark.motion import Motion

RIG = sample_rig("walker")
WALK = sample_motion("walk", RIG, 30.0)


def in_place(motion: Motion) -> Motion:
    ahead = motion.root_pos[-1] - motion.root_pos[0]
    return motion.moved(-np.linspace(0, 1, len(motion))[:, None] * ahead * [1.0, 1.0, 0.0])


def test_it_is_said_that_a_motion_walks_in_place() -> None:
    notes = [assess(Subject(motion, RIG)).notes for motion in (WALK, in_place(WALK))]
    assert [any("walks in place" in note for note in some) for some in notes] == [False, True]


def test_what_travels_is_compared_with_the_travel_that_its_source_lacks() -> None:
    treadmill = Subject(in_place(WALK), RIG)
    report = assess(Subject(WALK, RIG), source=treadmill)
    assert report.drift is not None
    assert report.contacts is not None
    assert report.contacts.f1 > 0.95
    assert report.drift.distance.max() < 0.1
    assert report.source is not None
    assert report.source.flags["skating"].mean() < 0.1
    assert any("the source walks in place" in note for note in report.notes)


def test_it_is_said_that_a_motion_walks_in_place_where_its_source_goes() -> None:
    report = assess(Subject(in_place(WALK), RIG), source=Subject(WALK, RIG))
    assert [note for note in report.notes if note.startswith("the motion walks in place")]


@pytest.mark.parametrize("motion", [in_place(WALK), WALK], ids=["in-place", "both-travel"])
def test_what_goes_as_its_source_does_is_compared_with_that(motion: Motion) -> None:
    report = assess(Subject(motion, RIG), source=Subject(motion, RIG))
    assert report.drift is not None
    assert report.drift.distance.max() < 1e-6
    assert not any("compared with the travel" in note for note in report.notes)
