"""Feet that stand at other times than the source's, and why: answers by hand."""

from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import Bool

from sim.report import assess
from sim.report.contact_timing import Discord, Standing, discord_of
from sim.trajectory import Subject
from spark.demo import gait
from spark.demo.sample import sample_motion, sample_rig
from spark.motion import Motion
from tests.helpers.stick import standing as still_stick
from tests.helpers.stick import stick_rig

FPS = 60
FAR, NEAR = np.radians(20), np.radians(3)
Contacts = Bool[np.ndarray, "T F"]


def steps(seconds: float = 6.0) -> Contacts:
    """A left foot that lifts for 0.5 s now and then, and a right one at other times."""
    times = np.arange(round(seconds * FPS)) / FPS
    lifts = [(0.5, 2.1, 4.6), (1.3, 3.2, 5.2)]
    return np.stack(
        [~np.any([(times >= t) & (times < t + 0.5) for t in own], axis=0) for own in lifts], axis=1
    )


def discord(own: Contacts, theirs: Contacts, pose: float, at_lag: float = 0.0) -> Discord | None:
    standing = Standing(("left foot", "right foot"), own, theirs, 1 / FPS)
    return discord_of(standing, pose, lambda lag: at_lag, "is it another motion?")


def never(contacts: Contacts) -> Contacts:
    return np.zeros_like(contacts)


def test_feet_that_stand_when_the_sources_do_are_no_discord() -> None:
    assert discord(steps(), steps(), NEAR) is None
    assert discord(steps(), steps(), FAR) is None


def test_feet_that_never_stand_are_told_and_nothing_is_asked_where_the_pose_is_the_sources() -> (
    None
):
    found = discord(never(steps()), steps(), NEAR)
    assert found is not None
    assert found.words == "feet stand at other times than the source's (F1 0.00)"
    assert (found.start, found.stop) == (0, len(steps()))
    asked = discord(never(steps()), steps(), FAR)
    assert asked is not None
    assert asked.words.endswith(": is it another motion?")


def test_a_mirrored_motion_is_told() -> None:
    lifted = ~steps()  # feet that stand for half a second now and then
    found = discord(lifted[:, ::-1], lifted, FAR)
    assert found is not None
    assert found.match.f1 == 0
    assert found.words.endswith(", and when its other foot does (F1 1.00): is it mirrored?")


def test_of_feet_of_another_motion_it_is_not_told_that_they_hover_or_slide_where_they_swing() -> (
    None
):
    rig = sample_rig("walker")
    walk, half = sample_motion("walk", rig, 60.0), round(30 * gait.stride_time(rig))
    early, source = walk.frames(half, len(walk)), walk.frames(0, len(walk) - half)
    sentences = [
        found.sentence
        for found in assess(Subject(early, rig), source=Subject(source, rig)).findings
    ]
    assert any("feet stand at other times" in sentence for sentence in sentences)
    assert not [each for each in sentences if "source's stand" in each or "hovers" in each]


@pytest.mark.parametrize("frames", [18, -18])
def test_a_motion_that_is_late_or_early_is_told_by_how_much(frames: int) -> None:
    lifted = ~steps()
    moved = np.roll(lifted, frames, axis=0)
    found = discord(moved, lifted, FAR)
    assert found is not None
    assert f"the motion is 0.30 s {'late' if frames > 0 else 'early'} (F1 1.00" in found.words
    # Poses that stay as far apart if shifted are another motion's that steps alike.
    other = discord(moved, lifted, FAR, at_lag=FAR)
    assert other is not None
    assert other.words.endswith(": is it another motion?")


def test_the_frames_are_those_of_the_longest_disagreement() -> None:
    """The source's left foot stands for 2 s, from 2.5 s on; the motion's 1.5 s later."""
    times = np.arange(360) / FPS
    theirs, own = (
        np.stack([(times >= start) & (times < start + 2), np.zeros(360, bool)], axis=1)
        for start in (2.5, 4.0)
    )
    found = discord(own, theirs, FAR, at_lag=FAR)
    assert found is not None
    assert found.match.f1 == pytest.approx(2 * 0.5 / 4)
    assert (found.start, found.stop) in {(150, 240), (270, 360)}


def gliding(start: float) -> Motion:
    """A stick man who stands, glides for one second at 1 m/s, 10 cm over the floor, and stands."""
    motion = still_stick(stick_rig(), 4 * FPS, FPS)
    times = np.arange(len(motion)) / FPS
    path = np.zeros((len(motion), 3))
    path[:, 0] = np.clip(times - start, 0, 1)
    path[:, 2] = np.where((times >= start) & (times < start + 1), 0.1, 0.0)
    return replace(motion, root_pos=motion.root_pos + path)


def test_nothing_is_said_of_swings_that_do_not_coincide() -> None:
    """Of the 4 s the source's feet stand 3 and the motion's, in the air by then, none."""
    rig = stick_rig()
    source, late = Subject(gliding(1.0), rig), Subject(gliding(2.5), rig)
    named = {f.measure for f in assess(late, source=source).findings}
    assert "swing_clearance" in named
    aloft = replace(late.motion, root_pos=late.motion.root_pos + np.array([0.0, 0.0, 0.3]))
    named = {f.measure for f in assess(Subject(aloft, rig), source=source).findings}
    assert "swing_clearance" not in named
    assert {"missed_contact", "invented_contact"} & named
