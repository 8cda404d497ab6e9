"""Footprints on stated ground: on top of it, out of walls, and on the end that it carries."""

from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import Bool, Float

from robots.model.known import known
from robots.solver.footholds import on_ground
from robots.solver.footprints import FootPlan, on_prints, plan_feet
from robots.solver.targets import targets_of
from spark.demo.sample import sample_motion, sample_rig
from spark.terrain import Terrain
from spark.transfer.canonical import to_canonical
from spark.transfer.distance_field import distance_field
from tests.helpers.grounds import box, together

HIGH = 0.3  # [m] of the box that feet stand on


def standing(terrain: Terrain, *, heel: bool, toe: bool, height: float = HIGH) -> FootPlan:
    """A foot of Ember that stands with its toes at the origin, pointing along X."""
    rig = sample_rig("walker")
    walk = to_canonical(sample_motion("walk", rig, 60.0), rig)
    robot = known("robot")
    plan = plan_feet(robot, targets_of(walk, robot))[0]
    around = distance_field(terrain, np.full(3, -3.0), np.full(3, 3.0), 0.05)
    return replace(
        plan,
        prints=np.zeros_like(plan.prints),
        contacts=np.tile([heel, toe], (len(plan.toe), 1)),
        ground=np.full(len(plan.toe), height),
        around=around,
    )


def corners(plan: FootPlan) -> Float[np.ndarray, "P 2"]:
    placed = on_prints(plan.flat, plan.prints[:1, 0] + 1j * plan.prints[:1, 1], plan.prints[:1, 2])
    return np.stack([placed[0].real, placed[0].imag], axis=-1)


def stands(plan: FootPlan) -> Bool[np.ndarray, "2"]:
    assert (plan.contacts == plan.contacts[0]).all()
    return plan.contacts[0]


@pytest.mark.parametrize(("carried", "expected"), [(0.7, [True, True]), (1.2, [True, False])])
def test_a_heel_over_an_edge_carries_no_foot_alone(carried: float, expected: list[bool]) -> None:
    """The box ends below the foot, so that it carries a share of its length, or behind it."""
    length = standing(box((-1, -1, 0), (1, 1, HIGH)), heel=True, toe=False).length
    plan = on_ground(standing(box((-carried * length, -1, 0), (1, 1, HIGH)), heel=True, toe=False))
    np.testing.assert_array_equal(stands(plan), expected)
    np.testing.assert_allclose(plan.prints, 0.0)
    np.testing.assert_allclose(plan.ground, HIGH)


def test_a_footprint_that_is_mostly_over_an_edge_is_shifted_onto_the_box() -> None:
    plan = on_ground(standing(box((-0.03, -1, 0), (1, 1, HIGH)), heel=True, toe=True))
    reach = corners(plan)[:, 0]
    assert (reach.max() + 0.03) / np.ptp(reach) > 0.6
    np.testing.assert_allclose(plan.ground, HIGH)


def test_a_footprint_in_a_wall_is_shifted_out_of_it() -> None:
    wall = box((-0.05, -1, 0), (1, 1, 2 * HIGH))
    plan = on_ground(standing(together(box((-2, -1, 0), (1, 1, HIGH)), wall), heel=True, toe=True))
    assert corners(plan)[:, 0].max() < -0.05
    np.testing.assert_allclose(plan.ground, HIGH)


def test_a_foot_beside_all_ground_stands_where_it_did() -> None:
    plan = standing(box((1, 1, 0), (2, 2, HIGH)), heel=False, toe=True, height=0.0)
    moved = on_ground(plan)
    for name in ("prints", "ground", "contacts"):
        np.testing.assert_array_equal(getattr(moved, name), getattr(plan, name))
