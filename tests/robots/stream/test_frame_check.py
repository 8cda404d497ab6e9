"""What no person's frames can be is refused, and what they can be is not."""

import numpy as np
import pytest

from robots.model.known import known
from robots.stream.frame_targets import Frame, ground_of
from robots.stream.stream import Stream
from spark.demo.sample import sample_motion, sample_rig
from spark.errors import FrameError
from spark.motion import Motion
from spark.rotation import quat_from_rotvec, quat_mul
from spark.transfer.canonical import to_canonical

RIG, EMBER = sample_rig("walker"), known("robot")
WALK = sample_motion("walk", RIG, 60.0).frames(0, 40)
UNITS = {"feet": 3.281, "inches": 39.37, "centimetres": 100.0, "millimetres": 1000.0}


def stream(motion: Motion = WALK) -> Stream:
    return Stream(RIG, EMBER, 1 / 60, ground_of(to_canonical(motion, RIG), EMBER))


def frame(t: int = 0, *, times: float = 1.0, up: float = 0.0) -> Frame:
    """A frame of the walk, the root's place times a number, and so much higher [m]."""
    return Frame(times * WALK.root_pos[t] + np.array([0.0, 0.0, up]), WALK.rotations[t])


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("first", [True, False])
def test_a_root_in_another_unit_is_told_with_the_unit(unit: str, first: bool) -> None:
    """From the first frame on, or from a later one; and metres are followed afterwards."""
    live, other = stream(), stream()
    if not first:
        live.step(frame(0)), other.step(frame(0))
    told = f"in {unit}: divide it by {UNITS[unit]:g}"
    for t in (1, 2):
        with pytest.raises(FrameError, match=told):
            live.step(frame(t, times=UNITS[unit]))
    np.testing.assert_array_equal(live.step(frame(3)), other.step(frame(3)))


@pytest.mark.parametrize("times", [0.01, 0.001, 1 / 39.37])
def test_a_root_that_is_too_small_is_under_the_floor(times: float) -> None:
    with pytest.raises(FrameError, match=r"under the floor at z = .*expected metres, Z up"):
        stream().step(frame(times=times))


def test_a_root_with_y_up_is_under_the_floor() -> None:
    place, turns, _ = frame()
    with pytest.raises(FrameError, match="Z up"):
        stream().step(Frame(place[[0, 2, 1]], turns))


def test_quaternions_turned_round_are_told() -> None:
    live = stream()
    for t in range(len(WALK)):
        with pytest.raises(FrameError, match=r"as xyzw .* expected wxyz"):
            live.step(Frame(WALK.root_pos[t], WALK.rotations[t][:, [1, 2, 3, 0]]))


def test_translations_in_another_unit_are_told() -> None:
    place, turns, _ = frame()
    for times in (100.0, 0.01):
        with pytest.raises(FrameError, match="times as long"):
            stream().step(Frame(place, turns, times * RIG.skeleton.offsets))
    stream().step(Frame(place, turns, 1.5 * RIG.skeleton.offsets))


@pytest.mark.parametrize("up", [-0.3, 0.5, 1.5])
def test_who_leaps_or_stands_on_a_box_or_in_a_hollow_is_followed(up: float) -> None:
    live = stream()
    for t in range(4):
        assert np.isfinite(live.step(frame(t, up=up * RIG.hip_height))).all()


def test_who_climbs_a_tower_is_followed() -> None:
    live = stream()
    for t in range(20):
        live.step(frame(t, up=0.5 * t))
    for t in range(20, 0, -1):
        live.step(frame(t, up=0.4 * t))


def test_who_is_far_away_on_another_floor_is_followed() -> None:
    away = np.array([2000.0, -3000.0, 40.0])
    live = stream(Motion(WALK.skeleton, 1 / 60, WALK.root_pos + away, WALK.rotations))
    live.step(Frame(WALK.root_pos[0] + away, WALK.rotations[0]))
    with pytest.raises(FrameError, match=r"under the floor at z = 40"):
        live.step(frame())


@pytest.mark.parametrize(
    ("turn", "hips"),
    [((90, 0), 0.12), ((-90, 0), 0.12), ((0, 90), 0.15), ((0, -90), 0.15), ((180, 0), 0.9)],
)
def test_who_lies_or_stands_on_the_hands_is_followed(turn: tuple[int, int], hips: float) -> None:
    """`turn` is about x and y [degrees]; the hips are so high [m]."""
    turns = WALK.rotations[0].copy()
    turns[0] = quat_mul(quat_from_rotvec(np.radians([*turn, 0.0])), turns[0])
    stream().step(Frame(np.array([0.0, 0.0, hips]), turns))
