"""Frames that repeat the one before: a walk with some of its frames held."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from sim.report import Subject, assess
from sim.report.stutter import repeated_frames, stutter_notes
from spark.demo.sample import sample_motion, sample_rig
from spark.motion import Motion
from tests.helpers.stick import standing, stick_rig

RIG = sample_rig("walker")
WALK = sample_motion("walk", RIG, 60.0)


def at(frames: Sequence[int]) -> Motion:
    """Frames of the walk, one after another."""
    rows = np.array(frames)
    return replace(WALK, root_pos=WALK.root_pos[rows], rotations=WALK.rotations[rows])


def test_a_walk_does_not_stutter_and_who_stands_does_not() -> None:
    assert stutter_notes(WALK, "the motion") == ()
    assert stutter_notes(standing(stick_rig(), 60, 60.0), "the motion") == ()


@pytest.mark.parametrize("lasting", [1, 3, 8])
def test_a_frame_that_is_held_is_found_for_as_long_as_it_is(lasting: int) -> None:
    motion = at([*range(50), *[49] * lasting, *range(50, len(WALK))])
    assert np.flatnonzero(repeated_frames(motion)).tolist() == [*range(50, 50 + lasting)]
    (note,) = stutter_notes(motion, "the source")
    assert note.startswith(f"the source stutters: {lasting} frame")
    assert note.endswith("the first of them frame 50")


def test_who_holds_still_for_longer_rests() -> None:
    assert not repeated_frames(at([*range(50), *[49] * 20, *range(50, len(WALK))])).any()


@pytest.mark.parametrize(("each", "fps"), [(2, "30"), (4, "15")])
def test_a_file_of_fewer_frames_is_told_its_rate(each: int, fps: str) -> None:
    motion = at([t // each * each for t in range(len(WALK))])
    report = assess(Subject(motion, RIG), source=Subject(WALK, RIG))
    (note,) = [note for note in report.notes if "stutters" in note]
    assert note.endswith(f": it is likely of {fps} fps, and not of 60")
