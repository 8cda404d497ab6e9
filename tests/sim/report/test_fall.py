"""How hard a stick man falls who jumps, at the right frame rate and at others."""

from dataclasses import replace

import numpy as np
import pytest

from sim.report import Subject, assess
from sim.report.fall import fall_of
from sim.trajectory import model_trajectory
from spark.constants import GRAVITY
from spark.motion import Motion
from tests.helpers.stick import standing, stick_rig

RIG = stick_rig()


def jumping(fps: float, *, gravity: float = GRAVITY, seconds: float = 0.5) -> Motion:
    """Stands, is in the air for so many seconds, stands."""
    motion = standing(RIG, round(2 * fps), fps)
    times = np.arange(len(motion)) / fps - 0.75
    flight = (times > 0) & (times < seconds)
    path = np.zeros((len(motion), 3))
    path[:, 2] = np.where(flight, 0.5 * gravity * times * (seconds - times), 0.0)
    return replace(motion, root_pos=motion.root_pos + path)


def note_of(motion: Motion) -> list[str]:
    return [note for note in assess(Subject(motion, RIG)).notes if note.startswith("in the air")]


@pytest.mark.parametrize("fps", [24.0, 60.0, 120.0])
@pytest.mark.parametrize("times", [0.5, 1.0, 2.0])
def test_a_jump_tells_the_frame_rate_that_it_was_taken_at(fps: float, times: float) -> None:
    jump = jumping(fps)
    motion = replace(jump, frame_time=jump.frame_time / times)
    subject = Subject(motion, RIG)
    clip = assess(subject).clip
    assert fall_of(subject, clip) == pytest.approx(GRAVITY * times**2, rel=1e-6)
    told = f"(at {fps:.3g} fps, not {times * fps:.4g}, it would fall so)"
    assert [told in note for note in note_of(motion)] == ([] if times == 1 else [True])


def test_a_unit_that_is_a_hundred_times_too_large_is_told_in_plain_digits() -> None:
    (note,) = note_of(jumping(600.0, gravity=100 * GRAVITY, seconds=0.1))
    assert note.endswith("(at 60 fps, not 600, it would fall so), or 100 times too large")


def test_of_a_robot_it_is_the_rate_that_is_wrong() -> None:
    jump = jumping(60.0, gravity=3.0)
    subject = Subject(jump, RIG, model_trajectory(RIG, jump))
    (note,) = [each for each in assess(subject).notes if each.startswith("in the air")]
    assert note.endswith("1.8 times too slow (at 108 fps, not 60, it would fall so)")


def test_who_stands_or_hangs_does_not_fall() -> None:
    hangs = jumping(60.0, gravity=1.0)
    subject = Subject(hangs, RIG)
    assert fall_of(subject, assess(subject).clip) is None
    assert note_of(standing(RIG, 60, 60.0)) == []


def test_of_two_motions_it_is_the_source_that_is_told() -> None:
    """A body of another size falls otherwise."""
    slow = Subject(jumping(60.0, gravity=3.0), RIG)
    report = assess(Subject(jumping(60.0), RIG), source=slow)
    assert any(note.startswith("in the air the source falls at 3.0 m/s²") for note in report.notes)
