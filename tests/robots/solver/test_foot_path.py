"""How high feet pass above the floor."""

from dataclasses import replace

import numpy as np
import pytest

from robots.model.morphology import Morphology
from robots.registry import find
from robots.solver.foot_path import (
    LET_DOWN,
    LEVEL,
    LEVEL_LIFT,
    MAX_UNEVEN,
    SETTLE,
    SETTLE_HOLD,
    STEP_HEIGHTS,
    STEP_RISE,
    STEP_SPEEDS,
    SWING_HOLD,
    footing_of,
)
from robots.solver.footprints import FootPlan, plan_feet
from robots.solver.targets import targets_of
from spark.demo.sample import sample_motion, sample_rig
from spark.smoothstep import smoothstep
from spark.transfer.canonical import to_canonical
from spark_sim.loading import load_robot

HIGHEST = STEP_HEIGHTS[-1] * (1 + LEVEL_LIFT)  # [hip heights] of any step


def planned() -> tuple[Morphology, FootPlan]:
    """Ember, and one of its feet in a walk."""
    rig = sample_rig("walker")
    walk = to_canonical(sample_motion("walk", rig, 60.0), rig)
    ember = load_robot(find("robot")).on_robot.robot
    return ember, plan_feet(ember, targets_of(walk, ember))[0]


@pytest.mark.parametrize("stood", [0.0, 0.03, 0.05, 0.4])
def test_feet_pass_as_high_above_the_floor_as_the_source_but_for_ground(stood: float) -> None:
    """`stood` [hip heights] is how high above the floor the source's feet stand."""
    ember, plan = planned()
    raised = stood * plan.hip_height
    plan.clearance[:] = raised + np.where(plan.stands, 0.0, 0.12 * plan.hip_height)
    lowest = footing_of(ember, plan).positions[:, 2].min(axis=0)
    frames, standing = np.arange(len(plan.toe)), np.flatnonzero(plan.stands)
    swinging = np.abs(frames[:, None] - np.flatnonzero(~plan.stands)).min(axis=1)
    rests = swinging * plan.frame_time > HIGHEST / STEP_RISE
    assert rests.sum() > 20
    np.testing.assert_allclose(lowest[rests], 0.0, atol=1e-9)
    apart = np.abs(frames[:, None] - standing).min(axis=1) * plan.frame_time
    pace = np.linalg.norm(np.gradient(plan.toe, plan.frame_time, axis=0), axis=1)
    steps = (apart > LET_DOWN) & (pace > 0.8 * plan.hip_height)
    assert steps.sum() > 5
    ground = max(raised - MAX_UNEVEN * plan.hip_height, 0.0)
    np.testing.assert_allclose(lowest[steps], plan.clearance[steps] - ground, atol=1e-9)


def test_where_no_step_is_taken_all_is_ground_that_feet_stand_on() -> None:
    ember, plan = planned()
    plan.toe[:], plan.prints[:] = plan.toe[0], plan.prints[0]
    plan.points[:] = plan.points[0]
    raised = 0.05 * plan.hip_height
    plan.clearance[:] = raised + np.where(plan.stands, 0.0, 0.12 * plan.hip_height)
    lowest = footing_of(ember, plan).positions[:, 2].min(axis=0)
    np.testing.assert_allclose(lowest, plan.clearance - raised, atol=1e-9)


@pytest.mark.parametrize("seconds", [0.08, 0.15, 0.4])
def test_a_foot_is_down_in_the_middle_of_a_contact_and_up_where_it_is_fast(seconds: float) -> None:
    """However fast it is before and after: it comes at 2 m/s, and leaves so."""
    ember, plan = planned()
    time = plan.frame_time * (np.arange(len(plan.toe)) - len(plan.toe) // 2)
    stands = np.abs(time) < seconds / 2
    along = 2.0 * np.sign(time) * np.maximum(np.abs(time) - seconds / 2, 0.0)
    plan.points[..., 0] += (along - plan.toe[:, 0])[:, None]
    plan.toe[:, 0], plan.contacts[:] = along, stands[:, None]
    plan.prints[:] = np.column_stack([np.zeros(len(time)), plan.toe[:, 1], plan.heading])
    plan.prints[stands, 1:] = plan.prints[stands, 1:].mean(axis=0)
    plan.clearance[:] = 0.0
    footing = footing_of(ember, plan)
    lowest = footing.positions[:, 2].min(axis=0)
    np.testing.assert_array_equal(lowest[np.abs(time) < 0.1 * seconds], 0.0)
    up = STEP_HEIGHTS[1] * plan.hip_height
    pivot = footing.positions[-2:, :2].mean(axis=0)
    speed = np.linalg.norm(np.gradient(pivot, plan.frame_time, axis=1), axis=0)
    assert np.all(lowest[speed > STEP_SPEEDS[-1] * plan.hip_height] >= 0.99 * up)
    rise = STEP_RISE * plan.hip_height * plan.frame_time
    assert np.abs(np.diff(lowest[~stands])).max() <= rise + 1e-9


def test_who_turns_on_the_toes_raises_the_heel() -> None:
    """A foot that stands all the time turns by 90 degrees within .3 s about the middle of its toes:
    the heel is off the floor while it is fast, the toes stay on it, where they are."""
    ember, plan = planned()
    time = plan.frame_time * (np.arange(len(plan.toe)) - len(plan.toe) // 2)
    plan.heading[:] = np.radians(90) * np.clip(time / 0.3 + 0.5, 0.0, 1.0)
    plan.toe[:], plan.contacts[:], plan.clearance[:] = 0.0, True, 0.0
    flat = plan.flat @ [1, 1j]
    turned = np.exp(1j * plan.heading)[:, None] * flat
    plan.points[:] = np.stack([turned.real, turned.imag, np.zeros(turned.shape)], axis=-1)
    plan.prints[:] = np.column_stack([plan.toe, plan.heading])
    heel, toes = np.split(footing_of(ember, plan).positions, [-2])
    turning = np.abs(time) < 0.1
    assert np.all(heel[:2, 2][:, turning] >= 0.99 * STEP_HEIGHTS[1] * plan.hip_height)
    assert np.all(toes[:, 2].min(axis=0) < STEP_HEIGHTS[1] * plan.hip_height)
    np.testing.assert_allclose(toes[:, :2].mean(axis=0), 0.0, atol=1e-9)
    still = np.abs(time) > 0.15 + 2 * HIGHEST / STEP_RISE
    np.testing.assert_array_equal(heel[:, 2][:, still], 0.0)


def test_feet_of_who_lies_are_kept_from_dragging_more_firmly_than_a_step_is_taken() -> None:
    """At 1 m/s over the floor all the time; only what is fast there is held so."""
    ember, plan = planned()
    time = plan.frame_time * np.arange(len(plan.toe))
    plan.contacts[:], plan.clearance[:], plan.prints[:] = False, 0.0, 0.0
    swings, lies, rests = (
        footing_of(ember, plan).shares[:, 2]
        for plan in (moved(plan, time, 0.0), moved(plan, time, 1.0), moved(plan, 0.0 * time, 1.0))
    )
    assert np.all(lies > 2 * swings)
    assert np.all(rests < swings)


@pytest.mark.parametrize(("tilt", "higher"), [(0.0, LEVEL_LIFT), (1.1 * LEVEL[1], 0.0)])
def test_a_level_foot_steps_higher_than_one_on_its_end(tilt: float, higher: float) -> None:
    """`tilt` [hip heights] is how far its heel is up, at 1 m/s all the time."""
    ember, plan = planned()
    plan.contacts[:], plan.clearance[:], plan.prints[:] = False, 0.0, 0.0
    plan = moved(plan, plan.frame_time * np.arange(len(plan.toe)), 0.0)
    plan.points[:, :2, 2] = tilt * plan.hip_height
    toes = footing_of(ember, plan).positions[-2:, 2] / plan.hip_height
    np.testing.assert_allclose(toes, STEP_HEIGHTS[-1] * (1 + higher), rtol=1e-9)


def test_a_foot_is_held_ever_more_firmly_along_the_floor_as_it_comes_to_stand() -> None:
    ember, plan = planned()
    plan.contacts[:], plan.clearance[:] = False, 0.0
    plan.contacts[60:] = True
    along = footing_of(ember, plan).shares[-2:, :2]
    before = round(SETTLE / plan.frame_time)
    assert np.all(along[..., 60:80] == 1.0)
    assert np.all(np.diff(along[..., 60 - before : 61], axis=-1) > 0.0)
    assert np.all(along[..., 59] < SETTLE_HOLD)
    np.testing.assert_allclose(along[..., : 59 - before], SWING_HOLD[0])


def moved(plan: FootPlan, along: np.ndarray, idle: float) -> FootPlan:
    """A flat foot that goes along X by so much [m]."""
    flat = plan.flat @ [1, 1j] + along[:, None]
    points = np.stack([flat.real, flat.imag, np.zeros(flat.shape)], axis=-1)
    toe, heading = np.column_stack([along, 0.0 * along]), 0.0 * along
    return replace(plan, points=points, toe=toe, heading=heading, idle=idle + 0.0 * along)


def test_a_foot_is_carried_at_an_even_pace_to_where_it_hardly_goes_itself() -> None:
    """A foot that goes 1 cm, within 0.1 s, on the way between two prints that are 20 cm apart:
    beside its own 6 m/s² (a smoothstep's) its toe is accelerated by at most 10 d / T². Carried as
    it goes itself, it would be by twenty times those 6."""
    ember, plan = planned()
    count, begin, end = len(plan.toe), 10, 34
    frames, swing = np.arange(count), slice(begin, end)
    own = 0.01 * smoothstep((frames - 19) / 6)
    plan.points[:] = plan.points[0]
    plan.points[..., 0] += own[:, None] - plan.toe[0, 0]
    plan.toe[:], plan.heading[:] = np.column_stack([own, np.zeros(count)]), plan.heading[0]
    plan.contacts[:] = True
    plan.contacts[swing] = False
    at = np.column_stack([0.2 * (frames >= end), np.zeros(count), plan.heading])
    plan.prints[:] = at
    toe = footing_of(ember, plan).positions[-2:, 0].mean(axis=0)
    pushed = np.abs(np.diff(toe, 2)).max() / plan.frame_time**2
    assert pushed < 6.0 + 10 * 0.2 / ((end - begin) * plan.frame_time) ** 2
