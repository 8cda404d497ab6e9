"""A rest pose with hanging feet is the same body as one that stands flat; high heels stay high."""

from dataclasses import replace

import numpy as np
import pytest

from spark.demo.sample import sample_motion, sample_rig
from spark.motion import Motion
from spark.rig.rig import Rig, understand
from spark.rig.roles import Role
from spark.rotation import quat_angle, quat_conj, quat_from_rotvec, quat_identity, quat_mul
from tests.helpers.rerig import rerig
from tests.helpers.stick import standing, stick_rig

FEET = Role.LEFT_FOOT, Role.RIGHT_FOOT


def pitched(rig: Rig, degrees: float) -> np.ndarray:
    """Axes for `rerig` after which feet and toes of the rest pose point down by so much from the
    T-pose, toed out by 10 degrees."""
    pose = quat_identity(np.zeros((len(rig.skeleton), 1)))
    for foot, out in zip(FEET, (1, -1), strict=True):
        yaw = quat_from_rotvec(np.radians([0.0, 0.0, 10.0 * out]))
        down = quat_from_rotvec(np.radians([0.0, degrees, 0.0]))
        pose[list(rig.skeleton.subtree(rig.roles.require(foot)))] = quat_mul(yaw, down)
    return quat_conj(quat_mul(pose, rig.tpose))


def resting(motion: Motion) -> Motion:
    """One frame of its rest pose: nothing shows how the feet stand."""
    rest = quat_identity(np.zeros((1, len(motion.skeleton), 1)))
    return replace(motion.picked(slice(1)), rotations=rest)


def without_tips(motion: Motion) -> Motion:
    """The same with feet that end at the toe joint."""
    skeleton = motion.skeleton
    kept = np.array(["head" in skeleton.names[j] for j in skeleton.end_parents])
    ends = skeleton.end_parents[kept], skeleton.end_offsets[kept]
    short = replace(skeleton, end_parents=ends[0], end_offsets=ends[1])
    return replace(motion, skeleton=short)


@pytest.mark.parametrize("degrees", [-25, 15, 30, 50])
def test_feet_that_are_pitched_at_rest_stand_as_their_toes_do(degrees: float) -> None:
    """Of a rest pose alone, without a motion."""
    rig = understand(standing(stick_rig(), 1))
    axes = pitched(rig, degrees)
    found = understand(resting(rerig(standing(rig, 1), axes)))
    assert np.degrees(quat_angle(found.tpose, quat_mul(rig.tpose, axes))).max() < 1e-3
    assert found.hip_height == pytest.approx(rig.hip_height)
    (note,) = (note for note in found.notes if "in the rest pose" in note)
    assert f"{abs(degrees)} degrees {'down' if degrees > 0 else 'up'}" in note


@pytest.mark.parametrize("height", [0.02, 0.06, 0.16])
def test_feet_on_level_toes_stand_as_they_rest(height: float) -> None:
    """Flat ones as those on high heels, whatever their slope."""
    rig = stick_rig()
    offsets = rig.skeleton.offsets.copy()
    for toe in (Role.LEFT_TOE, Role.RIGHT_TOE):
        offsets[rig.roles.require(toe)] = [0.1, 0.0, -height]
    skeleton = replace(rig.skeleton, offsets=offsets)
    found = understand(replace(standing(rig, 1), skeleton=skeleton))
    assert quat_angle(found.tpose, rig.tpose).max() < 1e-6
    assert not any("in the rest pose" in note for note in found.notes)


@pytest.mark.parametrize("degrees", [-30, 0, 30, 50])
def test_without_toes_the_motion_shows_how_feet_stand(degrees: float) -> None:
    rig = sample_rig("walker")
    motion = without_tips(sample_motion("walk", rig, 30.0))
    axes = pitched(rig, degrees)
    found = understand(rerig(motion, axes))
    feet = [rig.roles.require(role) for role in FEET]
    away = np.degrees(quat_angle(found.tpose, quat_mul(rig.tpose, axes)))[feet]
    assert away.max() < 5
    assert any("in the rest pose" in note for note in found.notes) == (degrees != 0)


def test_feet_that_hang_straight_down_are_a_humans_where_nothing_shows_them_stand() -> None:
    rig = stick_rig()
    slope = np.degrees(np.arctan2(0.08, 0.13))
    axes = pitched(rig, 85 - slope)
    found = understand(resting(rerig(without_tips(standing(rig, 1)), axes)))
    feet = [rig.roles.require(role) for role in FEET]
    away = np.degrees(quat_angle(found.tpose, quat_mul(rig.tpose, axes)))[feet]
    np.testing.assert_allclose(away, slope - 21, atol=0.1)


def test_who_lies_at_rest_and_in_the_motion_shows_nothing() -> None:
    rig = stick_rig()
    lying = quat_from_rotvec(np.array([np.pi / 2, 0.0, 0.0]))
    motion = without_tips(standing(rig, 30))
    motion.rotations[:, 0] = quat_mul(lying, motion.rotations[:, 0])
    found = understand(motion)
    assert quat_angle(found.tpose, rig.tpose).max() < 1e-6
