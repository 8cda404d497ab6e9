"""Arms that are thrown to and fro are marched through."""

from itertools import product

import numpy as np
import pytest

from robots.model.morphology import Morphology
from robots.solver.block import Block, blocks_of
from robots.solver.holds import Holds
from robots.solver.marching import abrupt, calmed
from robots.solver.solve import retarget
from robots.solver.targets import targets_of
from robots.solver.ways import cheapest
from robots.tree import Coordinates
from sim.report.derivatives import derivative
from spark.demo.sample import sample_rig
from spark.kinematics import forward
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec
from spark.transfer.canonical import CanonicalMotion

FRAME_TIME = 1 / 30


@pytest.fixture(scope="module")
def folded() -> CanonicalMotion:
    """Upper arms hang, forearms lie in each other before the belly and sway by 3 degrees."""
    rig = sample_rig("walker")
    time = FRAME_TIME * np.arange(120)
    rotations = np.tile([1.0, 0, 0, 0], (len(time), len(rig.skeleton), 1))
    for side, sign in (("left", 1.0), ("right", -1.0)):
        sway = 0.05 * np.sin(np.pi * time + sign)
        about_x, about_z = (-sign * (angle + sway) for angle in (1.2, 2.7))
        still = np.zeros(len(time))
        for name, turn in (
            ("upper_arm", (about_x, still, still)),
            ("forearm", (still, still, about_z)),
        ):
            moved = list(rig.skeleton.subtree(rig.roles.require(Role(f"{side}_{name}"))))
            rotations[:, moved] = quat_from_rotvec(np.stack(turn, axis=1))[:, None]
    hips = np.tile([0.0, 0.0, rig.hip_height], (len(time), 1))
    return CanonicalMotion(rig, FRAME_TIME, rotations, hips, 0.0)


def repeated(source: CanonicalMotion, times: int) -> CanonicalMotion:
    """One motion after another, each of 4 s."""
    rotations, hips = np.tile(source.rotations, (times, 1, 1)), np.tile(source.hips, (times, 1))
    return CanonicalMotion(source.rig, source.frame_time, rotations, hips, source.floor_z)


def left_shoulder(robot: Morphology) -> tuple[Block, int]:
    """The arms, and the first joint of the left one."""
    arms = blocks_of(robot)[1]
    shoulder = int(robot.links[robot.rig.roles.require(Role.LEFT_UPPER_ARM)])
    return arms, next(j for j in robot.tree.chain(shoulder) if j in arms.joints)


def jerked(
    source: CanonicalMotion, robot: Morphology, *spells: slice
) -> tuple[Block, Coordinates, np.ndarray]:
    """The arms, a solution whose left shoulder jumps in every second frame of some spells, and the
    frames of each spell."""
    arms, joint = left_shoulder(robot)
    solved = retarget(source, robot).coordinates
    angles, thrown = solved.angles.copy(), np.zeros((len(spells), len(source)), dtype=bool)
    for own, mask in zip(spells, thrown, strict=True):
        angles[own.start : own.stop : 2, joint] += 0.8
        mask[own] = True
    return arms, Coordinates(solved.pos, solved.quat, angles), thrown


def test_the_cheapest_way_is_that_of_all_ways() -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        costs, turned = rng.uniform(size=(5, 3)), rng.uniform(size=(4, 3, 3))
        ways = np.array(list(product(range(3), repeat=5)))
        turns = turned[np.arange(4), ways[:, 1:], ways[:, :-1]]
        best = (costs[np.arange(5), ways].sum(axis=1) + turns.sum(axis=1)).argmin()
        np.testing.assert_array_equal(cheapest(costs, turned), ways[best])


def test_folded_arms_that_hardly_move_are_not_thrown(
    folded: CanonicalMotion, ember: Morphology
) -> None:
    result = retarget(folded, ember)
    positions, _ = forward(result.motion)
    for side in ("left", "right"):
        hand = positions[:, ember.rig.roles.require(Role(f"{side}_hand"))]
        thrown = np.linalg.norm(derivative(hand, FRAME_TIME, 2, 0.05), axis=1)
        assert np.percentile(thrown, 99) < 1.0  # [m/s²]; the source's is 0.2


def test_marching_calms_an_arm_and_leaves_the_rest(
    folded: CanonicalMotion, ember: Morphology
) -> None:
    arms, joint = left_shoulder(ember)
    targets = targets_of(folded, ember)
    calm = ember.tpose.angles.repeat(len(folded), axis=0)
    thrown = calm.copy()
    thrown[::6, joint] += 0.8
    still = np.tile([1.0, 0, 0, 0], (len(folded), 1))
    q = Coordinates(targets.hips, still, thrown)
    assert not abrupt(ember, targets, Coordinates(targets.hips, still, calm), arms).any()
    assert abrupt(ember, targets, q, arms).mean() > 0.9
    marched = calmed(ember, targets, Holds.none(len(q)), q, arms, abrupt(ember, targets, q, arms))
    before, after = (np.abs(np.diff(way.angles[1:], 2, axis=0)).max() for way in (q, marched))
    assert after < before / 10
    others = [j for j in range(len(ember.tree)) if j not in arms.joints]
    np.testing.assert_allclose(marched.angles[:, others], q.angles[:, others], atol=1e-9)
    np.testing.assert_allclose(marched.pos, q.pos, atol=1e-9)


def test_marching_begins_and_ends_with_what_leads_there(
    folded: CanonicalMotion, ember: Morphology
) -> None:
    arms, q, (thrown,) = jerked(folded, ember, slice(58, 62))
    targets, holds = targets_of(folded, ember), Holds.none(len(q))
    marched = calmed(ember, targets, holds, q, arms, thrown).angles
    changed = np.flatnonzero((np.abs(marched - q.angles) > 1e-9).any(axis=1))
    assert changed.min() >= 28  # a second before
    assert changed.max() <= 91  # and after
    assert np.abs(np.diff(marched, 2, axis=0)).max() < 0.16  # a tenth of what it was


def test_spells_are_marched_through_as_each_alone(
    folded: CanonicalMotion, ember: Morphology
) -> None:
    source = repeated(folded, 3)
    arms, q, thrown = jerked(source, ember, slice(46, 50), slice(236, 238))
    targets, holds = targets_of(source, ember), Holds.none(len(q))
    both = calmed(ember, targets, holds, q, arms, thrown.any(axis=0)).angles
    first, second = (calmed(ember, targets, holds, q, arms, own).angles for own in thrown)
    assert (both != q.angles).any(axis=1)[[48, 236]].all()
    np.testing.assert_allclose(both[:140], first[:140], atol=1e-6)
    np.testing.assert_allclose(both[140:], second[140:], atol=1e-6)


def test_an_arm_that_is_thrown_onto_another_way_and_back_stays_on_the_first(
    folded: CanonicalMotion, ember: Morphology
) -> None:
    source = repeated(folded, 2)
    arms, joint = left_shoulder(ember)
    solved = retarget(source, ember).coordinates
    angles, thrown = solved.angles.copy(), np.zeros(len(source), dtype=bool)
    angles[60:180, joint] += 0.8
    thrown[[60, 180]] = True
    q = Coordinates(solved.pos, solved.quat, angles)
    targets, holds = targets_of(source, ember), Holds.none(len(q))
    marched = calmed(ember, targets, holds, q, arms, thrown).angles[:, joint]
    assert np.abs(marched - solved.angles[:, joint]).max() < 0.2


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_few_frames_need_no_marching(
    folded: CanonicalMotion, ember: Morphology, frames: int
) -> None:
    assert len(retarget(folded.frames(0, frames), ember).coordinates) == frames
