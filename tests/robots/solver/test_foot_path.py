"""How high feet pass above the floor."""

import numpy as np
import pytest

from robots.model.morphology import Morphology
from robots.registry import find
from robots.solver.foot_path import LET_DOWN, MAX_UNEVEN, footing_of
from robots.solver.footprints import FootPlan, plan_feet
from robots.solver.targets import targets_of
from spark.demo.sample import sample_motion, sample_rig
from spark.transfer.canonical import to_canonical
from spark_sim.loading import load_robot


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
    np.testing.assert_allclose(lowest[plan.stands], 0.0, atol=1e-9)
    frames, standing = np.arange(len(plan.toe)), np.flatnonzero(plan.stands)
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
def test_a_foot_is_down_from_the_first_frame_that_it_stands_to_the_last(seconds: float) -> None:
    """Whatever its speed before and after: it comes at 2 m/s, and leaves so."""
    ember, plan = planned()
    time = plan.frame_time * (np.arange(len(plan.toe)) - len(plan.toe) // 2)
    stands = np.abs(time) < seconds / 2
    along = 2.0 * np.sign(time) * np.maximum(np.abs(time) - seconds / 2, 0.0)
    plan.points[..., 0] += (along - plan.toe[:, 0])[:, None]
    plan.toe[:, 0], plan.contacts[:] = along, stands[:, None]
    plan.prints[:] = np.column_stack([np.zeros(len(time)), plan.toe[:, 1], plan.heading])
    plan.prints[stands, 1:] = plan.prints[stands, 1:].mean(axis=0)
    lowest = footing_of(ember, plan).positions[:, 2].min(axis=0)
    np.testing.assert_array_equal(lowest[stands], 0.0)
