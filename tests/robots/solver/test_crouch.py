"""Crouching less deep, for hips that flex less than a person's."""

from dataclasses import replace

import numpy as np
import pytest

from robots.model.known import known
from robots.solver.crouch import less_deep
from robots.solver.trunk import beyond_flexion
from spark.demo.sample import sample_motion
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec, quat_mul
from spark.transfer.canonical import CanonicalMotion, canonical_positions, to_canonical
from spark.transfer.seats import Seat
from tests.helpers.sitting import RIG, SITS, sitting

T1 = known("booster_t1")
BOWED = sitting(knees=70.0, lean=70.0)  # it reaches for the floor
DEEPEST = (SITS.start + SITS.stop) // 2
LEGS = tuple(role for role in Role if role.part in ("upper_leg", "lower_leg"))


def excess(motion: CanonicalMotion) -> np.ndarray:
    return beyond_flexion(motion, canonical_positions(motion), T1)[:, 0]


def thighs(motion: CanonicalMotion) -> np.ndarray:
    """How far [rad] the left one is raised from hanging."""
    joints = [RIG.roles.require(role) for role in (Role.LEFT_UPPER_LEG, Role.LEFT_LOWER_LEG)]
    hip, knee = canonical_positions(motion, joints).swapaxes(0, 1)
    thigh = (knee - hip) / np.linalg.norm(knee - hip, axis=1, keepdims=True)
    return np.arccos(-thigh[:, 2])


def test_thighs_give_back_one_half_of_what_hips_cannot_flex() -> None:
    higher = less_deep(BOWED, T1, ())
    missing = excess(BOWED)[DEEPEST]
    assert missing > np.radians(20)
    lowered = thighs(BOWED) - thighs(higher)
    assert lowered[DEEPEST] == pytest.approx(missing / 2, rel=0.01)
    np.testing.assert_allclose(lowered[[0, -1]], 0.0, atol=1e-3)
    assert excess(higher).max() < 0.7 * excess(BOWED).max()


def test_hips_come_up_and_feet_stay() -> None:
    higher = less_deep(BOWED, T1, ())
    rise = higher.hips - BOWED.hips
    assert rise[DEEPEST, 2] > 0.05
    np.testing.assert_allclose(rise[:, :2], 0.0, atol=1e-12)
    np.testing.assert_allclose(rise[[0, -1]], 0.0, atol=1e-3)
    one, other = (canonical_positions(each, RIG.contact_joints) for each in (BOWED, higher))
    np.testing.assert_allclose(one, other, atol=2e-3)


def test_the_rest_of_the_body_is_turned_as_before() -> None:
    legs = {RIG.roles.require(role) for role in LEGS}
    others = [j for j in range(len(RIG.skeleton)) if j not in legs]
    higher = less_deep(BOWED, T1, ())
    np.testing.assert_array_equal(higher.rotations[:, others], BOWED.rotations[:, others])


def test_who_sits_stays_on_the_seat() -> None:
    seat = Seat(SITS.start, SITS.stop, high=0.5)
    assert excess(BOWED)[DEEPEST] > 0.1
    seated = less_deep(BOWED, T1, (seat,))
    np.testing.assert_allclose(seated.hips[DEEPEST], BOWED.hips[DEEPEST], atol=1e-6)


def test_hips_that_flex_far_enough_follow_the_source_itself() -> None:
    walk = to_canonical(sample_motion("walk", RIG, 30.0), RIG)
    assert less_deep(walk, T1, ()) is walk
    lower = sitting(knees=60.0, lean=60.0)
    assert less_deep(lower, T1, ()) is not lower
    assert less_deep(lower, known("unitree_g1"), ()) is lower


def test_who_falls_forwards_out_of_a_crouch_stays_as_deep() -> None:
    """From the middle on the whole body is pitched by 60 degrees, and no longer over its feet."""
    falls = BOWED.rotations.copy()
    falls[DEEPEST:] = quat_mul(
        quat_from_rotvec(np.array([0.0, np.radians(60), 0.0])), falls[DEEPEST:]
    )
    fallen = replace(BOWED, rotations=falls)
    np.testing.assert_allclose(excess(fallen), 0.0, atol=1e-6)
    assert less_deep(fallen, T1, ()) is fallen


@pytest.mark.parametrize(("height", "rises"), [(0.07, False), (0.3, True)])
def test_a_knee_that_is_on_the_ground_stays_there(height: float, rises: bool) -> None:
    """It kneels on the right one, or holds it so high [m] over the floor, and bows over the left
    thigh."""
    kneels = BOWED.rotations.copy()
    skeleton, roles = RIG.skeleton, RIG.roles
    thigh, shank = (roles.require(Role(f"right_{part}")) for part in ("upper_leg", "lower_leg"))
    kneels[:, list(skeleton.subtree(thigh))] = quat_from_rotvec(np.zeros(3))
    kneels[:, list(skeleton.subtree(shank))] = quat_from_rotvec(np.array([0.0, np.pi / 2, 0.0]))
    down = replace(BOWED, rotations=kneels, hips=np.tile(BOWED.hips[:1], (len(BOWED), 1)))
    knee = canonical_positions(down, [shank])[:, 0, 2] - down.floor_z
    down = replace(down, hips=down.hips + np.outer(height - knee, [0.0, 0.0, 1.0]))
    assert excess(down)[DEEPEST] > np.radians(20)
    higher = less_deep(down, T1, ())
    assert (higher.hips[DEEPEST, 2] - down.hips[DEEPEST, 2] > 0.05) == rises
    assert (higher is down) != rises
