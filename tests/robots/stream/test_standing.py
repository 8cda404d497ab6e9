"""Which feet of a stream carry a body where none is slow enough to stand."""

from dataclasses import replace

import numpy as np
import pytest

from robots.model.known import known
from robots.stream.frame_targets import Frame, FrameReader, ground_of
from robots.stream.standing import SourceFeet, Standing
from spark.demo.sample import sample_motion, sample_rig
from spark.transfer.canonical import to_canonical

RIG, EMBER = sample_rig("walker"), known("robot")
FPS = 60
SOURCE = to_canonical(sample_motion("walk", RIG, 60.0).frames(0, 90), RIG)
READER = FrameReader(RIG, EMBER, ground_of(SOURCE, EMBER))
LEFT, RIGHT = 0, 1


def stands(
    speeds: tuple[float, float],
    heights: tuple[float, float],
    *,
    fall: float = 0.0,
    hips: float = 1,
    aside: float = 0.0,
    ground: list[float] | None = None,
) -> np.ndarray:
    """Of a body whose feet go forwards so fast [m/s] and so high [m, over where they stand],
    `aside` [m] of it, which falls by so much [g], whose hips are so high [of a T-pose's]. It knows
    `ground` [m] under them, which is changed where it stands on other one."""
    standing = Standing(READER, 1 / FPS)
    rotations = np.tile([1.0, 0, 0, 0], (len(RIG.skeleton), 1))
    own = READER.targets(Frame(np.array([0.0, 0, RIG.hip_height]), rotations))
    frames: list[SourceFeet] = []
    for k in range(standing.history + 3):
        time, feet, com = k / FPS, own.feet.copy(), own.com.copy()
        feet[..., 0] += np.array(speeds)[:, None] * time
        feet[..., 1] += aside
        feet[..., 2] = READER.ground.low + np.array(heights)[:, None]
        com[2] -= READER.scale * fall * 9.81 / 2 * time**2
        targets = replace(own, feet=feet, com=com, hips=own.hips * [1, 1, hips])
        frames.append(standing.feet(targets))
    at, (told, over) = standing.history, standing.motion(frames, standing.history)
    np.testing.assert_allclose(told, np.abs(speeds)[:, None] * [1, 1], atol=1e-9)
    none = [(False, False)] * 2
    ground = [0.0, 0.0] if ground is None else ground
    return np.array(standing.of(frames, at, none, told, over, ground))


def test_the_slower_and_lower_foot_carries() -> None:
    found = stands((0.4, 2.0), (0.0, 0.15))
    assert found[LEFT].any()
    assert not found[RIGHT].any()
    found = stands((-0.4, 0.3), (0.0, 0.0))  # against each other
    assert found[RIGHT].any()
    assert not found[LEFT].any()


def test_feet_that_sway_with_the_body_both_carry() -> None:
    assert stands((0.4, 0.4), (0.0, 0.0)).all()


@pytest.mark.parametrize(
    ("speed", "fall", "hips"),
    [(0.4, 0.9, 1.0), (0.9, 0.0, 1.0), (0.4, 0.0, 0.4)],
    ids=["in the air", "in a step", "on the ground"],
)
def test_nothing_carries(speed: float, fall: float, hips: float) -> None:
    assert not stands((speed, speed), (0.0, 0.0), fall=fall, hips=hips).any()


def test_who_stands_on_one_foot_does_not_creep_on_the_other() -> None:
    found = stands((0.0, 0.4), (0.0, 0.0))
    assert found[LEFT].all()
    assert not found[RIGHT].any()


def test_a_foot_that_is_still_on_a_step_stands_there() -> None:
    """While the other swings higher, and nothing else carries the body, which does not fall."""
    ground = [0.0, 0.0]
    found = stands((0.0, 1.5), (0.3, 0.5), ground=ground)
    assert found[LEFT].any()
    assert not found[RIGHT].any()
    assert ground == pytest.approx([0.3, 0.0])
    again = [0.3, 0.3]  # from then on, both feet stand there
    assert stands((0.0, 0.0), (0.3, 0.3), ground=again).all()
    assert again == [0.3, 0.3]


@pytest.mark.parametrize(
    ("speeds", "heights", "fall", "aside"),
    [
        ((0.0, 1.5), (0.3, 0.5), 0.9, 0.0),
        ((0.0, 0.0), (0.3, 0.0), 0.0, 0.0),
        ((0.0, 1.5), (0.08, 0.5), 0.0, 0.0),
        ((0.0, 1.5), (0.3, 0.5), 0.0, 1.0),
    ],
    ids=["in a jump", "held up beside one that stands", "as high as floors are off", "far away"],
)
def test_ground_is_not_told_from_feet(
    speeds: tuple[float, float], heights: tuple[float, float], fall: float, aside: float
) -> None:
    ground = [0.0, 0.0]
    stands(speeds, heights, fall=fall, aside=aside, ground=ground)
    assert ground == [0.0, 0.0]


def test_feet_are_over_the_highest_ground_that_is_known() -> None:
    below = Standing(READER, 1 / FPS).below
    high = [[0.5, 0.62], [0.2, 0.3]]
    assert below(high, [0.0, 0.5]) == [0.5, 0.0]
    assert below(high, [0.23, 0.7]) == [0.23, 0.23]
