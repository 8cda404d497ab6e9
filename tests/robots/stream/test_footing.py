"""How a stream's feet are held, and how high they step."""

from dataclasses import replace

import numpy as np
import pytest

from robots.model.known import known
from robots.solver.window_targets import PointTargets
from robots.stream.foot import Foot, settling
from robots.stream.footing import ContactTracker
from robots.stream.frame_targets import Frame, FrameReader, FrameTargets, ground_of
from spark.demo.sample import sample_motion, sample_rig
from spark.transfer.canonical import to_canonical

RIG, EMBER = sample_rig("walker"), known("robot")
FRAME_TIME = 1 / 60
SOURCE = to_canonical(sample_motion("walk", RIG, 60.0).frames(0, 90), RIG)
READER = FrameReader(RIG, EMBER, ground_of(SOURCE, EMBER))
LEFT = len(EMBER.soles[0])  # points of the first sole: at its heel two, two at its ball, two toes


def standing() -> FrameTargets:
    """Both feet flat on the floor."""
    rotations = np.tile([1.0, 0, 0, 0], (len(RIG.skeleton), 1))
    own = READER.targets(Frame(np.array([0.0, 0, RIG.hip_height]), rotations))
    feet = own.feet.copy()
    feet[..., 2] = READER.ground.low
    return replace(own, feet=feet, clearance=np.zeros(2), pitched=own.pitched * [1, 1, 0])


def after(heel_speed: float, heel_height: float) -> PointTargets:
    """A foot that stood, and of which the heel has so far moved for a fifth of a second: so fast
    [m/s] to the side, so high [m] over the toes."""
    tracker, begun = ContactTracker(READER, FRAME_TIME), standing()
    tracker.begin(begun, begun, 1)
    points = np.zeros((sum(map(len, EMBER.soles)), 3))
    for k in range(12):
        feet = begun.feet.copy()
        feet[0, 0] += [0.0, heel_speed * FRAME_TIME * k, heel_height]
        held = tracker.update(replace(begun, feet=feet), points)
    return held


def test_a_standing_foot_is_on_the_floor_and_held() -> None:
    held = after(0.0, 0.0)
    np.testing.assert_allclose(held.positions[0, :LEFT, 2], 0.0, atol=1e-9)
    np.testing.assert_allclose(held.holds[0, :LEFT], 1.0)


def test_who_turns_on_the_toes_raises_the_heel_alone() -> None:
    held = after(1.0, 0.0)
    heights = held.positions[0, :LEFT, 2] / EMBER.rig.hip_height
    assert (heights[:2] > 0.028).all()  # from there the report sees no foot skate
    np.testing.assert_allclose(heights[-2:], 0.0, atol=1e-9)
    np.testing.assert_allclose(held.holds[0, LEFT - 2 : LEFT], 1.0)


def test_a_foot_rises_before_it_moves() -> None:
    """In the first frame that it is let go it may be as high as fast feet step, where it is."""
    tracker, begun = ContactTracker(READER, FRAME_TIME), standing()
    tracker.begin(begun, begun, 1)
    points = np.zeros((sum(map(len, EMBER.soles)), 3))
    for _ in range(12):
        held = tracker.update(begun, points)
    feet = begun.feet.copy()
    while (held.holds[0, :LEFT] == 1.0).all():
        feet = feet.copy()
        feet[0, :, 0] += 1.5 * FRAME_TIME  # [m]
        held = tracker.update(replace(begun, feet=feet), points)
    assert (held.holds[0, :LEFT, :2] > 0.7).all()
    assert (held.positions[0, :LEFT, 2] > 0.028 * EMBER.rig.hip_height).all()


def test_who_stands_on_the_toes_does_not_stand_on_the_heel() -> None:
    raised = 0.03 * RIG.standing_height / 1.75  # low enough for a heel that stands alone
    held = after(0.0, raised)
    assert (held.holds[0, :2, 2] < 0.7).all()
    np.testing.assert_allclose(held.holds[0, LEFT - 2 : LEFT], 1.0)


def test_a_foot_that_stood_over_the_floor_is_put_down_on_it() -> None:
    tracker, begun = ContactTracker(READER, FRAME_TIME), standing()
    tracker.begin(begun, begun, 1)
    points = np.zeros((sum(map(len, EMBER.soles)), 3))
    over = 0.04 * EMBER.rig.hip_height  # of which a recorded floor is off
    for moved in [0.0] * 12 + [0.02] * 12 + [0.0] * 3:  # [m] a frame: it stands, steps, and comes
        begun = replace(
            begun, feet=begun.feet + np.array([moved, 0, 0]), clearance=np.full(2, over)
        )
        held = tracker.update(begun, points)
        if moved:
            swing = held.positions[-1, :, 2]
    np.testing.assert_allclose(swing, over, atol=1e-9)
    assert (held.positions[-1, :, 2] < over / 10).all()


def test_a_foot_on_a_step_settles_at_any_rate_and_never_sinks() -> None:
    rises = []
    for frame_time in (1 / 24, 1 / 120):
        foot, pace = Foot(planted=(True, True)), (settling(frame_time), 1.0)
        foot.stand_on(0.3, 0.34, 0.34, *pace)
        for _ in range(round(0.5 / frame_time)):
            foot.stand_on(0.3, 0.30, 0.34, *pace)
        rises.append(foot.rise)
        foot.stand_on(0.3, 0.33, 0.34, *pace)
        assert foot.rise == 0.33
    assert rises[0] == pytest.approx(rises[1], abs=1e-9)
    assert 0.31 < rises[0] < 0.33


@pytest.mark.parametrize("own", [-0.02, 0.0, 0.3])
def test_a_foot_left_below_comes_up_to_the_ground_step_by_step(own: float) -> None:
    """The source has been lifted, and the robot's foot is still where it was."""
    foot = Foot(planted=(True, True))
    rises = []
    for _ in range(20):
        foot.stand_on(1.0, 0.8, own, settling(1 / 60), 0.1)
        rises.append(foot.rise)
    expected = np.minimum(max(own, 0.0) + 0.1 * np.arange(1, 21), 0.8)
    np.testing.assert_allclose(rises, expected, atol=1e-9)
