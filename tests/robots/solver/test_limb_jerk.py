"""Strikes: how jerky a source's limbs are, and a robot's may be."""

import numpy as np
import pytest

from robots.model.known import known
from robots.solver import smoothness
from robots.solver.limb_jerk import limb_dofs, limb_jerks
from robots.solver.solve import retarget
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_about
from spark.transfer.canonical import to_canonical
from tests.helpers.stick import joint, standing, stick_rig

EMBER = known("ember")


@pytest.mark.parametrize("fps", [24.0, 30.0, 60.0, 120.0, 240.0])
def test_the_jerk_of_a_sine_is_that_of_its_third_derivative(fps: float) -> None:
    """Differences over 50 ms lose 3 % of 1.5 Hz, and lines between frames of 24 fps 7 % more."""
    time = np.arange(round(4 * fps)) / fps
    angle, rate = 0.1 * np.sin(2 * np.pi * 1.5 * time), 2 * np.pi * 1.5
    down = np.stack([np.sin(angle), np.zeros_like(angle), -np.cos(angle)], axis=1)
    still = np.tile([0.0, 1.0, 0.0], (len(time), 1))
    found = limb_jerks({Role.LEFT_UPPER_LEG: down, Role.RIGHT_UPPER_ARM: still}, 1 / fps)
    middle = found[len(time) // 4 : -len(time) // 4]
    np.testing.assert_allclose(middle[:, 1:], 0.0, atol=1e-6)
    share = np.sqrt((middle[:, 0] ** 2).mean()) / (0.1 * rate**3 / np.sqrt(2))
    assert 0.88 < share < 1.03  # the windows hold no whole waves


def test_single_frames_of_noise_are_no_haste() -> None:
    """At 120 fps, 0.1 degrees in alternate frames: their own third differences say 24,000."""
    angle = np.radians(0.1) * (np.arange(480) % 2)
    arm = np.stack([np.sin(angle), np.cos(angle), np.zeros_like(angle)], axis=1)
    assert limb_jerks({Role.LEFT_UPPER_ARM: arm}, 1 / 120).max() < 100


def test_limbs_have_the_hinges_between_trunk_and_end() -> None:
    g1 = known("unitree_g1")
    dofs = limb_dofs(g1)
    assert [len(own) for own in dofs] == [6, 6, 7, 7]
    assert len({dof for own in dofs for dof in own}) == 26


def kicking(rig: Rig, fps: float = 60.0) -> Motion:
    """It raises its right thigh, kicks within 0.1 s, and comes back."""
    motion = standing(rig, round(3 * fps) + 1, fps)
    time = np.arange(len(motion)) / fps
    raised = np.interp(time, [0.5, 1.0, 2.0, 2.5], [0.0, 1.0, 1.0, 0.0])
    folded = np.interp(time, [0.5, 1.0, 1.45, 1.55, 1.65, 2.0, 2.5], [0, 1, 1, 0, 1, 1, 0])
    motion.rotations[:, joint(Role.RIGHT_UPPER_LEG)] = quat_about("y", -1.0 * raised)
    motion.rotations[:, joint(Role.RIGHT_LOWER_LEG)] = quat_about("y", 1.5 * folded)
    return motion


def knee(motion: Motion, rig: Rig) -> np.ndarray:
    positions, _ = forward(motion)
    hip, bend, ankle = (
        positions[:, rig.roles.require(Role(f"right_{part}"))]
        for part in ("upper_leg", "lower_leg", "foot")
    )
    thigh, shank = bend - hip, ankle - bend
    cosine = (thigh * shank).sum(1) / np.linalg.norm(thigh, axis=1) / np.linalg.norm(shank, axis=1)
    return np.arccos(np.clip(cosine, -1, 1))


def test_a_kick_is_not_smoothed_away(monkeypatch: pytest.MonkeyPatch) -> None:
    rig = stick_rig()
    source = to_canonical(kicking(rig), rig)
    struck = slice(80, 105)  # frames of 60 fps around 1.55 s
    extended = [knee(retarget(source, EMBER).motion, EMBER.rig)[struck].min()]
    monkeypatch.setattr(smoothness, "JERK_SHARE", 0.0)
    extended += [knee(retarget(source, EMBER).motion, EMBER.rig)[struck].min()]
    assert extended[0] < 0.75
    assert extended[0] < extended[1] - 0.15
