"""Whose travel was taken out gets it back, and nobody else's."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import Float

from spark.demo import gait
from spark.demo.sample import sample_motion, sample_rig
from spark.rotation import quat_from_yaw, quat_mul, quat_rotate
from spark.transfer.canonical import CanonicalMotion, at_frame_time, to_canonical
from spark.transfer.in_place import pace_of, way_taken_out, with_travel
from spark.transfer.loops import continued

FPS = 60.0
RIG = sample_rig("walker")
WALK = gait.walk(RIG, FPS)


def even_pace(source: CanonicalMotion) -> Float[np.ndarray, "T 3"]:
    """The way of who goes from its first place to the last without a change of pace, as Mixamo's
    "In Place" takes it out."""
    return np.linspace(0, 1, len(source))[:, None] * over_ground(source)[-1]


def over_ground(source: CanonicalMotion) -> Float[np.ndarray, "T 3"]:
    """The hips' own way."""
    return (source.hips - source.hips[0]) * [1.0, 1.0, 0.0]


def turning(source: CanonicalMotion, speed: float) -> CanonicalMotion:
    """The same along a way that turns by so much [rad/s]."""
    yaw = quat_from_yaw(speed * source.frame_time * np.arange(len(source)))
    steps = quat_rotate(yaw[:-1], np.diff(source.hips, axis=0))
    hips = np.concatenate([source.hips[:1], source.hips[:1] + np.cumsum(steps, axis=0)])
    return replace(source, rotations=quat_mul(yaw[:, None], source.rotations), hips=hips)


@pytest.mark.parametrize("yaw", [0.0, 2.0])
@pytest.mark.parametrize("taken_out", [even_pace, over_ground])
@pytest.mark.parametrize("fps", [24.0, FPS])
def test_a_walk_in_place_gets_its_way_back(
    yaw: float, taken_out: Callable[[CanonicalMotion], Float[np.ndarray, "T 3"]], fps: float
) -> None:
    there = quat_from_yaw(np.array(yaw))
    walk = at_frame_time(WALK, 1 / fps)
    walk = replace(
        walk, rotations=quat_mul(there, walk.rotations), hips=quat_rotate(there, walk.hips)
    )
    way = taken_out(walk)
    back = way_taken_out(replace(walk, hips=walk.hips - way))
    assert back is not None
    np.testing.assert_allclose(back, way, atol=0.07)  # of 4 m
    assert pace_of(back, 1 / fps) == pytest.approx(pace_of(way, 1 / fps), rel=0.04)


@pytest.mark.parametrize("speed", [-1.5, 0.5])
def test_pinned_hips_that_turn_get_a_way_that_turns(speed: float) -> None:
    walk = turning(WALK, speed)
    way = over_ground(walk)
    back = way_taken_out(replace(walk, hips=walk.hips - way))
    assert back is not None
    np.testing.assert_allclose(back, way, atol=0.1)


def test_a_fast_belt_is_known_less_exactly_and_found() -> None:
    sprint = at_frame_time(replace(WALK, frame_time=WALK.frame_time / 4), 1 / 30)  # 4.9 m/s
    way = over_ground(sprint)
    back = way_taken_out(replace(sprint, hips=sprint.hips - way))
    assert back is not None
    assert np.linalg.norm(back[-1] - way[-1]) < 0.05 * np.linalg.norm(way[-1])


def test_it_is_as_long_on_a_body_of_any_size() -> None:
    small = sample_rig("dancer")
    walk = gait.walk(small, FPS)
    back = way_taken_out(replace(walk, hips=walk.hips - even_pace(walk)))
    assert back is not None
    assert np.linalg.norm(back[-1] - even_pace(walk)[-1]) < 0.03 * np.linalg.norm(back[-1])


def test_a_loop_in_place_goes_on_at_one_pace() -> None:
    cycle = WALK.frames(20, 21 + round(FPS * gait.stride_time(RIG)))
    long, own = continued(replace(cycle, hips=cycle.hips - even_pace(cycle)))
    travelling, notes = with_travel(long)
    steps = np.diff(travelling.picked(own).hips, axis=0)
    assert np.abs(steps[0] - steps[-1]).max() < 0.05 * np.linalg.norm(steps, axis=1).max()
    assert len(notes) == 1
    assert "in place" in notes[0]


def other_motions() -> dict[str, CanonicalMotion]:
    """What is no walk in place, though some of it slides or skates."""
    wave, squat = (to_canonical(sample_motion(name, RIG, FPS), RIG) for name in ("wave", "squat"))
    way, time = over_ground(WALK), np.arange(60) / FPS
    ahead = np.outer(np.arange(len(squat)) / FPS, [1.0, 0.0, 0.0])
    sways = 0.5 * np.outer(np.sin(2 * np.pi * time), [1.0, 0.0, 0.0])
    return {
        "walk": WALK,
        "wave": wave,
        "squat": squat,
        "slides along": replace(squat, hips=squat.hips + ahead),
        "skates on": replace(WALK, hips=WALK.hips + 0.5 * way),
        "walks backwards as it steps ahead": replace(WALK, hips=WALK.hips - 2 * way),
        "slides to and fro": replace(wave.frames(0, len(time)), hips=wave.hips[0] + sways),
        "one frame": WALK.frames(0, 1),
        "a moment": replace(WALK.frames(0, 15), hips=(WALK.hips - way)[:15]),
    }


@pytest.mark.parametrize("name", other_motions())
def test_all_other_motions_stay_what_they_are(name: str) -> None:
    source = other_motions()[name]
    same, notes = with_travel(source)
    assert same is source
    assert notes == ()
