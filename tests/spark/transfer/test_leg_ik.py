"""Legs of any bones."""

import numpy as np
import pytest

from spark.rotation import quat_from_rotvec, quat_rotate
from spark.transfer.leg_ik import leg_rotations


@pytest.mark.parametrize(("thigh", "shank"), [(0.4, 0.0), (0.0, 0.4), (0.0, 0.0), (0.4, 1e-12)])
def test_a_bone_without_length_turns_as_a_number(thigh: float, shank: float) -> None:
    """What has no length can't bend; the rest points to where the ankle should be."""
    rng = np.random.default_rng(0)
    down = np.array([0.0, 0.0, -1.0])
    move = 0.1 * rng.normal(size=(50, 3))
    bones = np.tile(thigh * down, (50, 1)), np.tile(shank * down, (50, 1))
    upper, lower = leg_rotations(*bones, np.tile([1.0, 0.0, 0.0, 0.0], (50, 1)), move)
    for turned in (upper, lower):
        np.testing.assert_allclose(np.linalg.norm(turned, axis=-1), 1.0)
    if thigh or shank:
        ankle = quat_rotate(upper, bones[0]) + quat_rotate(lower, bones[1])
        goal = bones[0] + bones[1] + move
        cosine = (ankle * goal).sum(-1) / np.linalg.norm(ankle, axis=-1)
        np.testing.assert_allclose(cosine / np.linalg.norm(goal, axis=-1), 1.0, atol=1e-6)


def bent_leg(degrees: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Thigh and shank of .4 m whose knee is bent by so much, forwards, and the thigh's rotation."""
    down = np.array([0.0, 0.0, -0.4])
    angle = np.radians(degrees)[:, None]
    still = np.tile([1.0, 0.0, 0.0, 0.0], (len(angle), 1))
    shank = quat_rotate(quat_from_rotvec(angle * [0.0, 1.0, 0.0]), down)
    return np.broadcast_to(down, shank.shape), shank, still


def bend_after(degrees: np.ndarray, nearer: float) -> np.ndarray:
    """The knee's angle [degrees] once the ankle is so much nearer to the hip [m]."""
    thigh, shank, upper = bent_leg(degrees)
    leg = thigh + shank
    move = -nearer * leg / np.linalg.norm(leg, axis=-1, keepdims=True)
    turned = leg_rotations(thigh, shank, upper, move)
    thigh, shank = quat_rotate(turned[0], thigh), quat_rotate(turned[1], shank)
    across = np.cross(thigh, shank)
    assert np.abs(across[:, [0, 2]]).max() < 1e-12  # in its own plane
    return np.degrees(np.arctan2(across[:, 1], (thigh * shank).sum(-1)))


def test_a_leg_that_is_not_moved_stays() -> None:
    """However straight it is, and where a recording overstretches it, too."""
    degrees = np.linspace(-15, 120, 271)
    np.testing.assert_allclose(bend_after(degrees, 0.0), degrees, atol=1e-6)


@pytest.mark.parametrize("nearer", [0.0, 0.002, 0.005, 0.01, 0.02])
def test_a_knee_goes_through_straight_without_a_jump(nearer: float) -> None:
    """The source's knee moves by 1/20 degree from one frame to the next."""
    steps = np.abs(np.diff(bend_after(np.arange(-12, 12, 0.05), nearer)))
    assert steps.max() < 0.5


@pytest.mark.parametrize("degrees", [-11.0, -5.0, 0.0, 5.0])
def test_an_overstretched_knee_that_is_moved_bends_forwards(degrees: float) -> None:
    after = bend_after(np.array([degrees]), 0.02)
    assert after > 20


@pytest.mark.parametrize("nearer", [-0.001, 0.003, 0.01])
def test_a_bent_leg_reaches_what_it_is_asked_for(nearer: float) -> None:
    thigh, shank, upper = bent_leg(np.linspace(10, 120, 111))
    goal = (thigh + shank) * (1 - nearer / np.linalg.norm(thigh + shank, axis=-1))[:, None]
    turned = leg_rotations(thigh, shank, upper, goal - thigh - shank)
    ankle = quat_rotate(turned[0], thigh) + quat_rotate(turned[1], shank)
    np.testing.assert_allclose(ankle, goal, atol=1e-4)


@pytest.mark.parametrize("sideways", [5.0, 10.0, 30.0, -10.0])
@pytest.mark.parametrize("nearer", [0.001, 0.005, 0.02])
def test_a_knee_that_bends_sideways_goes_through_straight_without_a_jump(
    sideways: float, nearer: float
) -> None:
    """As bow legs and knock knees of recordings do: forwards by 1/100 degree more a frame."""
    degrees = np.arange(-3, 3, 0.01)
    thigh, shank, upper = bent_leg(degrees)
    shank = quat_rotate(quat_from_rotvec(np.radians([sideways, 0.0, 0.0])), shank)
    leg = thigh + shank
    move = -nearer * leg / np.linalg.norm(leg, axis=-1, keepdims=True)
    for turned, bone in zip(leg_rotations(thigh, shank, upper, move), (thigh, shank), strict=True):
        steps = np.linalg.norm(np.diff(quat_rotate(turned, bone), axis=0), axis=-1)
        assert steps.max() < 0.001
