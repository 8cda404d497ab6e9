"""Angles between the parts of a robot and of its source."""

from dataclasses import replace

import numpy as np
import pytest

from robots.likeness import foot_error, hand_error, limb_error, trunk_error
from robots.model.known import known
from robots.model.motion import RobotMotion
from spark.motion import Motion
from spark.rig.roles import Role
from spark.rotation import quat_conj, quat_from_rotvec, quat_mul, quat_rotate

ROBOT = known("ember")


def standing() -> RobotMotion:
    return RobotMotion(ROBOT, ROBOT.tpose.at(np.zeros(3, dtype=int)), 1 / 30)


def turned(motion: Motion, role: Role, rotvec: list[float]) -> Motion:
    """The same with one of its joints turned in the world, and what hangs on it."""
    skeleton, j = motion.skeleton, ROBOT.rig.roles.require(role)
    rotations = motion.rotations.copy()
    local = quat_rotate(quat_conj(ROBOT.rig.tpose[skeleton.parents[j]]), np.array(rotvec))
    rotations[:, j] = quat_mul(quat_from_rotvec(local), rotations[:, j])
    return replace(motion, rotations=rotations)


def test_a_motion_is_like_itself() -> None:
    still = standing()
    for error in (limb_error, foot_error, hand_error, trunk_error):
        assert error(still.motion, ROBOT.rig, still) == pytest.approx(0.0, abs=1e-6)


def test_one_foot_that_points_aside_is_half_of_both() -> None:
    still = standing()
    aside = turned(still.motion, Role.LEFT_FOOT, [0.0, 0.0, 0.5])
    assert foot_error(aside, ROBOT.rig, still) == pytest.approx(0.25)
    assert limb_error(aside, ROBOT.rig, still) == pytest.approx(0.0, abs=1e-6)
    assert trunk_error(aside, ROBOT.rig, still) == pytest.approx(0.0, abs=1e-6)


def test_a_hand_that_is_turned_about_itself_is_turned() -> None:
    """Half of both, and no limb is: a hand's twist shows in no direction."""
    still = standing()
    twisted = turned(still.motion, Role.LEFT_HAND, [0.0, 1.2, 0.0])
    assert hand_error(twisted, ROBOT.rig, still) == pytest.approx(0.6)
    assert limb_error(twisted, ROBOT.rig, still) == pytest.approx(0.0, abs=1e-6)


def test_a_thigh_that_is_raised_takes_three_parts_of_eight_along() -> None:
    """Thigh and shank of eight limbs, and the foot below them."""
    still = standing()
    raised = turned(still.motion, Role.LEFT_UPPER_LEG, [0.0, -0.4, 0.0])
    assert limb_error(raised, ROBOT.rig, still) == pytest.approx(0.4 * 2 / 8, rel=0.02)
    assert foot_error(raised, ROBOT.rig, still) == pytest.approx(0.2)


def test_a_trunk_leans_by_its_lowest_spine_less_than_that_turns() -> None:
    """Its hips stay below, where they are."""
    still = standing()
    bowed = turned(still.motion, Role.SPINE, [0.0, 0.5, 0.0])
    found = trunk_error(bowed, ROBOT.rig, still)
    assert found is not None
    assert 0.2 < found < 0.5
    assert foot_error(bowed, ROBOT.rig, still) == pytest.approx(0.0, abs=1e-6)


def test_what_one_body_lacks_has_no_error() -> None:
    still = standing()
    roles = ROBOT.rig.roles
    none = replace(roles, roles=tuple(r if r in (Role.PELVIS, None) else None for r in roles.roles))
    bare = replace(ROBOT.rig, roles=none)
    assert foot_error(still.motion, bare, still) is None
    assert hand_error(still.motion, bare, still) is None
    assert trunk_error(still.motion, bare, still) is None
