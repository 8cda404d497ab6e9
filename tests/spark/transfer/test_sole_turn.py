"""Feet turn up as far as they would be in the floor, about their ankles, and no further."""

from dataclasses import replace

import numpy as np
import pytest

from spark.kinematics import forward
from spark.rig.feet import sole_positions
from spark.rig.roles import Group, Role
from spark.rotation import quat_angle, quat_from_rotvec, quat_from_yaw, quat_identity, quat_mul
from spark.transfer.canonical import (
    CanonicalMotion,
    canonical_positions,
    from_canonical,
    to_canonical,
)
from spark.transfer.foot_lock import lock_feet
from spark.transfer.sole_turn import turn_foot, turn_up
from tests.helpers.stick import joint, standing, stick_rig

FRAMES = 31
LEFT = Group.LEFT_LEG


def pitched(angle: float | np.ndarray, yaw: float = 0.0, sunk: float = 0.0) -> CanonicalMotion:
    """The stick man, turned by `yaw` and lowered by `sunk` [m], his left foot pitched down by
    `angle` [rad]."""
    motion = to_canonical(standing(stick_rig(), FRAMES), stick_rig())
    pitch = np.zeros((FRAMES, 3))
    pitch[:, 1] = angle
    rotations = motion.rotations.copy()
    for role in (Role.LEFT_FOOT, Role.LEFT_TOE):
        rotations[:, joint(role)] = quat_from_rotvec(pitch)
    rotations = quat_mul(quat_from_yaw(np.full((FRAMES, 1), yaw)), rotations)
    return replace(motion, rotations=rotations, hips=motion.hips - np.array([0.0, 0.0, sunk]))


def heights(motion: CanonicalMotion) -> np.ndarray:
    """Of the points of the left sole [m]."""
    positions, world = forward(from_canonical(motion))
    return sole_positions(motion.rig.soles[0], positions, world)[..., 2]


def up(motion: CanonicalMotion, least: float) -> CanonicalMotion:
    return turn_foot(motion, LEFT, turn_up(motion, LEFT, np.full(FRAMES, least)))


@pytest.mark.parametrize("yaw", [0.0, 2.0])
@pytest.mark.parametrize("angle", [-0.1, 0.1, 0.3])
def test_the_lowest_point_comes_up_to_the_floor(angle: float, yaw: float) -> None:
    """Of toes that point into it, and of heels."""
    motion = pitched(angle, yaw)
    assert heights(motion).min() < -0.003
    turned = up(motion, 0.0)
    np.testing.assert_allclose(heights(turned).min(axis=1), 0, atol=1e-9)
    ankle = joint(Role.LEFT_FOOT)
    still = [canonical_positions(each, [ankle]) for each in (motion, turned)]
    np.testing.assert_array_equal(*still)
    by = quat_angle(motion.rotations[:, ankle], turned.rotations[:, ankle])
    assert by.max() < abs(angle) + 1e-6


def test_a_foot_over_the_floor_is_not_turned() -> None:
    for motion, least in ((pitched(0.3), -0.2), (pitched(-0.4), -0.2), (pitched(0.0), -0.001)):
        assert up(motion, least) is motion


def test_a_foot_that_dips_for_a_frame_turns_up_in_time() -> None:
    """Of toes that push off one frame may be in the floor, by 2 cm: the foot is there as far as it
    has to be, and no quicker than 0.1 s let it."""
    motion = pitched(0.3)
    motion.hips[:, 2] -= heights(motion).min()
    motion.hips[15, 2] -= 0.02
    turned = up(motion, 0.0)
    assert heights(turned).min() > -1e-9
    by = quat_angle(*(each.rotations[:, joint(Role.LEFT_FOOT)] for each in (motion, turned)))
    assert by.max() > np.radians(4)
    assert max(by[:9].max(), by[22:].max()) < 1e-9
    assert np.abs(np.diff(by)).max() < 1.1 * by.max() * motion.frame_time / 0.1


def test_a_foot_that_is_too_low_as_a_whole_comes_to_lie_level() -> None:
    turned = up(pitched(0.2, sunk=0.03), 0.0)
    assert np.ptp(heights(turned), axis=1).max() < 0.01
    assert np.ptp(heights(pitched(0.2))) > 0.04


def test_a_foot_that_hangs_is_not_turned_far_to_rise_little() -> None:
    """Its toes are nearly under its ankle: 3 mm would take 6 degrees and more."""
    angles = np.linspace(0.9, 1.3, FRAMES)
    hanging = pitched(angles)
    low = heights(hanging).min(axis=1)
    turn = turn_up(hanging, LEFT, low + 0.003)
    assert np.degrees(quat_angle(turn, quat_identity(turn))).max() < 3


def test_a_foot_is_not_turned_over() -> None:
    """Of who lies on the floor, or stands in it up to the knees."""
    turn = turn_up(pitched(1.5, sunk=0.4), LEFT, np.zeros(FRAMES))
    assert quat_angle(turn, quat_identity(turn)).max() < 0.61


def test_a_foot_that_points_into_the_floor_does_not_bend_the_knee() -> None:
    """Seen so for a third of the time, by 17 degrees: it turns up, as a hand does at the wrist."""
    angle = 0.3 * ((np.arange(FRAMES) > 10) & (np.arange(FRAMES) < 20))
    source = replace(pitched(angle), floor_z=0.0)
    held = lock_feet(source, source)
    legs = [joint(role) for role in (Role.LEFT_UPPER_LEG, Role.LEFT_LOWER_LEG)]
    bent = quat_angle(source.rotations[:, legs], held.rotations[:, legs])
    assert heights(source).min() < -0.03
    assert heights(held).min() > -0.006
    assert np.degrees(bent.max()) < 8
