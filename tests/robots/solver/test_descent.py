"""Gauss-Newton steps that are too long: halved where they are, and only there; damped in repairs,
where walls are firm."""

import numpy as np
import pytest

from robots.kinematics import forward_kinematics
from robots.model.morphology import Morphology
from robots.solver.block import blocks_of
from robots.solver.descent import Steps, solve_block
from robots.solver.footprints import points_of
from robots.solver.holds import Holds
from robots.solver.objective import linearize
from robots.solver.repair_descent import Repair, solve_spells
from robots.solver.spells import Spells
from robots.solver.targets import targets_of
from robots.tree import Coordinates
from spark.demo.sample import sample_rig
from spark.transfer.canonical import CanonicalMotion

COUNT = 120
HOVERING = slice(70, COUNT)


def standing() -> CanonicalMotion:
    rig = sample_rig("walker")
    rotations = np.tile([1.0, 0, 0, 0], (COUNT, len(rig.skeleton), 1))
    return CanonicalMotion(rig, 1 / 60, rotations, np.tile([0, 0, 0.9], (COUNT, 1)), 0.0)


def raised(robot: Morphology) -> Coordinates:
    """The T-pose on the floor, and for a while 5 cm above it."""
    tpose = robot.tpose
    poses, links = (
        forward_kinematics(robot.tree, tpose),
        [robot.sole_points(s) for s in robot.soles],
    )
    pairs = [(int(k), p) for own, rest in links for k, p in zip(own, rest, strict=True)]
    pos = np.repeat(tpose.pos, COUNT, axis=0)
    pos[:, 2] -= min(poses.point(link, point)[2, 0] for link, point in pairs)
    pos[HOVERING, 2] += 0.05
    return Coordinates(
        pos, np.repeat(tpose.quat, COUNT, axis=0), np.repeat(tpose.angles, COUNT, axis=0)
    )


def drawn_down(robot: Morphology, q: Coordinates) -> Holds:
    """The pelvis, while it hovers, to far below the ground."""
    poses, pelvis = forward_kinematics(robot.tree, q), robot.rig.pelvis
    link, center = int(robot.links[pelvis]), robot.centers[pelvis]
    positions = poses.point(link, center) - [[0.0], [0.0], [0.5 * robot.rig.hip_height]]
    shares = np.zeros((3, COUNT))
    shares[2, HOVERING] = 2.5
    points = np.repeat(center[:, None], COUNT, axis=1)
    return Holds(np.array([link]), points[None], positions[None], shares[None])


def test_whoever_hovers_comes_down_though_the_first_step_ends_deep_in_the_floor(
    ember: Morphology,
) -> None:
    targets, block = targets_of(standing(), ember), blocks_of(ember)[0]
    start = raised(ember)
    holds = drawn_down(ember, start)
    before = linearize(ember, targets, holds, start, block, [], with_jacobian=False).cost
    q = solve_block(ember, targets, holds, start, block, Steps(6, 0.0, 0.1))
    after = linearize(ember, targets, holds, q, block, [], with_jacobian=False).cost
    assert after[HOVERING].mean() < 0.5 * before[HOVERING].mean()
    assert (q.pos[90:, 2] < start.pos[90:, 2] - 0.04).all()


def test_a_step_that_gains_less_than_asked_is_the_last(ember: Morphology) -> None:
    targets, block, start = targets_of(standing(), ember), blocks_of(ember)[0], raised(ember)
    holds = drawn_down(ember, start)

    def found(steps: Steps) -> Coordinates:
        return solve_block(ember, targets, holds, start, block, steps)

    one, last, more = (
        found(Steps(1, 0.0, 0.1)),
        found(Steps(6, 1.0, 0.1)),
        found(Steps(2, 0.0, 0.1)),
    )
    np.testing.assert_allclose(last.pos, one.pos, atol=1e-12)
    np.testing.assert_allclose(last.angles, one.angles, atol=1e-12)
    assert np.abs(more.pos - one.pos).max() > 1e-4


@pytest.mark.parametrize("above", [0.07, 0.03])  # [m] the floor
def test_a_repair_comes_down_to_a_floor_far_firmer_than_repairs_have(
    ember: Morphology, above: float
) -> None:
    block, firm = blocks_of(ember)[0], np.full(COUNT, 729.0)
    hovering = raised(ember)
    holds = drawn_down(ember, hovering)
    up = np.array([0.0, 0.0, above - 0.05])
    start = Coordinates(hovering.pos + up, hovering.quat, hovering.angles)
    spells, free = Spells(np.array([COUNT])), np.zeros(COUNT, dtype=bool)
    targets = targets_of(standing(), ember)
    broken = Repair(ember, block, spells, targets, holds, start, firm, free, exact=True)
    poses = forward_kinematics(ember.tree, solve_spells(broken))
    lowest = np.min([points_of(ember, poses, sole)[:, 2].min(0) for sole in ember.soles], axis=0)
    assert lowest.min() > -0.001
    assert lowest[90:].max() < 0.02
