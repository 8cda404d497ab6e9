"""The floor pushes a body from under its feet, or from as far beyond them as it accelerates."""

from dataclasses import replace

import numpy as np
import pytest

from spark.constants import GRAVITY
from spark.rig.feet import sole_positions
from spark.rig.roles import Role
from spark.transfer.canonical import CanonicalMotion, canonical_positions, to_canonical
from spark.transfer.pressure import acceleration, beyond_feet
from tests.helpers.stick import standing, stick_rig, without

FRAMES = 60
HEIGHT = 1.0  # [m] of the centre of mass


def still() -> CanonicalMotion:
    rig = stick_rig()
    return to_canonical(standing(rig, FRAMES), rig)


def pushed(motion: CanonicalMotion, sideways: float, up: float = 0.0) -> np.ndarray:
    """A path over the middle of the hips that passes it in the middle frame, so accelerated
    [m/s²]."""
    t = (np.arange(FRAMES) - FRAMES // 2) * motion.frame_time
    at = np.array([*motion.hips[0, :2], motion.floor_z + HEIGHT])
    return at + 0.5 * t[:, None] ** 2 * [0.0, sideways, up]


def beyond(motion: CanonicalMotion, path: np.ndarray) -> float:
    return float(beyond_feet(motion, path)[FRAMES // 2])


@pytest.mark.parametrize("up", [0.0, 5.0])
def test_as_far_as_the_force_leans(up: float) -> None:
    motion = still()
    world = np.broadcast_to(motion.rig.tpose, motion.rotations.shape)
    soles = [sole_positions(s, canonical_positions(motion), world) for s in motion.rig.soles]
    edge = max(float(sole[0, :, 1].max()) for sole in soles) - motion.hips[0, 1]
    expected = (HEIGHT * 6.0 / (GRAVITY + up) - edge) / motion.rig.hip_height
    assert expected > 0.05
    # the path rises by a little within the Gaussian's width
    assert beyond(motion, pushed(motion, 6.0, up)) == pytest.approx(expected, abs=0.01)


def test_nothing_while_it_stands_and_while_a_push_stays_under_the_feet() -> None:
    motion = still()
    assert beyond(motion, pushed(motion, 0.0)) == 0.0
    assert beyond(motion, pushed(motion, 0.5)) == 0.0


def test_a_raised_foot_bears_nothing() -> None:
    motion = still()
    rig = motion.rig
    lifted = tuple(
        replace(s, offsets=s.offsets + np.array([0.0, 0.0, 0.3])) if s.side == "left" else s
        for s in rig.soles
    )
    high = replace(rig, shaped_soles=lifted)
    path = pushed(motion, -1.2)
    assert beyond(motion, path) < 0.05 < beyond(replace(motion, rig=high), path)


def test_a_rig_without_soles_is_pushed_anywhere() -> None:
    motion = still()
    feet = (Role.LEFT_FOOT, Role.LEFT_TOE, Role.RIGHT_FOOT, Role.RIGHT_TOE)
    bare = replace(motion, rig=without(motion.rig, *feet))
    assert not bare.rig.soles
    assert beyond(bare, pushed(motion, 6.0)) == 0.0


@pytest.mark.parametrize("frames", [1, 2, 3])
def test_a_few_frames_are_no_motion(frames: int) -> None:
    path = np.arange(frames)[:, None] * [1.0, 0.0, 0.0]
    np.testing.assert_allclose(acceleration(path, 1 / 30), 0.0, atol=1e-9)
