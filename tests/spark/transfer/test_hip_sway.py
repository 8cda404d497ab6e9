"""The centre of mass of any body accelerates over the ground as the source's does, scaled."""

from dataclasses import replace

import numpy as np
import pytest

from sim.report.mass import human_mass
from spark.kinematics import forward
from spark.rig.feet import sole_positions
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec
from spark.transfer.analytic import transfer
from spark.transfer.canonical import CanonicalMotion, from_canonical, to_canonical
from spark.transfer.hip_sway import center_of_mass, sway_hips
from spark.transfer.leg_fit import fit_legs
from tests.helpers.stick import joint, standing, stick_rig

SECONDS = 4.0
TAU = 0.08  # [s]


def with_trunk(longer: float) -> Rig:
    """The stick man with a trunk so many times as long."""
    rig = stick_rig()
    offsets = rig.skeleton.offsets.copy()
    for role in (Role.SPINE, Role.NECK, Role.LEFT_UPPER_ARM, Role.RIGHT_UPPER_ARM):
        offsets[joint(role), 2] *= longer
    return replace(rig, skeleton=replace(rig.skeleton, offsets=offsets))


def leaning(hz: float, fps: float = 120.0, most: float = 0.2) -> CanonicalMotion:
    """The stick man, knees a little bent, bends to the left and right so often a second, by at most
    so much [rad]."""
    rig = stick_rig()
    motion = standing(rig, round(SECONDS * fps) + 1, fps)
    angle = most * np.cos(2 * np.pi * hz * np.arange(len(motion)) / fps)
    motion.rotations[:, joint(Role.SPINE)] = quat_from_rotvec(angle[:, None] * [1.0, 0.0, 0.0])
    for side in ("left", "right"):
        for part, bend in (("upper_leg", -0.3), ("lower_leg", 0.6), ("foot", -0.3)):
            turn = quat_from_rotvec(np.array([0.0, bend, 0.0]))
            motion.rotations[:, joint(Role(f"{side}_{part}"))] = turn
    return to_canonical(motion, rig)


def away(source: CanonicalMotion, moved: CanonicalMotion) -> np.ndarray:
    """How far the centre of mass is from the source's over the ground [m]."""
    return (center_of_mass(moved) - center_of_mass(source))[:, :2]


def soles(motion: CanonicalMotion) -> np.ndarray:
    positions, world = forward(from_canonical(motion))
    return np.stack([sole_positions(sole, positions, world) for sole in motion.rig.soles])


@pytest.mark.parametrize(("hz", "fps"), [(1.0, 60.0), (3.0, 120.0), (3.0, 240.0), (6.0, 240.0)])
def test_what_a_longer_trunk_adds_is_left_the_less_the_quicker_it_is(hz: float, fps: float) -> None:
    """Of a frequency w, 1 / (1 + (w tau)²) is left, at any frame rate."""
    source = leaning(hz, fps)
    before = transfer(source, with_trunk(1.5))
    after = sway_hips(source, before)
    middle = slice(len(source) // 4, -len(source) // 4)
    was, left = (np.ptp(away(source, m)[middle, 1]) for m in (before, after))
    assert was > 0.01
    assert left / was == pytest.approx(1 / (1 + (2 * np.pi * hz * TAU) ** 2), rel=0.08, abs=0.02)


def test_a_source_is_followed_as_far_as_the_floor_could_push_it() -> None:
    """One with a longer trunk sways more than the target does. A calm one is followed; one that
    shakes would have to be pushed from beyond its feet, and the target need not shake."""
    for angle, least, most in ((0.01, 0.95, 1.0), (0.3, 0.0, 0.1)):
        source = transfer(leaning(6.0, 240.0, angle), with_trunk(1.5))
        before = transfer(source, stick_rig())
        after = sway_hips(source, before)
        middle = slice(len(source) // 4, -len(source) // 4)
        was, left = (np.ptp(away(source, m)[middle, 1]) for m in (before, after))
        quick = (2 * np.pi * 6.0 * TAU) ** 2
        assert least < (1 - left / was) * (1 + quick) / quick < most, angle


def test_feet_stay() -> None:
    source = leaning(3.0)
    before = transfer(source, with_trunk(1.5))
    after = sway_hips(source, before)
    assert np.ptp(after.hips[:, 1]) > 0.005
    np.testing.assert_allclose(soles(after), soles(before), atol=1e-3)


def test_a_lean_that_stays_leaves_the_hips() -> None:
    source = leaning(0.0)
    before = transfer(source, with_trunk(1.5))
    np.testing.assert_allclose(sway_hips(source, before).hips, before.hips, atol=1e-9)


def test_longer_steps_at_one_speed_leave_the_hips() -> None:
    still = leaning(0.0)
    source = replace(still, hips=still.hips + np.arange(len(still))[:, None] * [0.01, 0.0, 0.0])
    before = fit_legs(source, transfer(source, with_trunk(1.5)))
    assert before.hips[-1, 0] > 1.05 * source.hips[-1, 0]
    np.testing.assert_allclose(sway_hips(source, before).hips, before.hips, atol=1e-9)


def test_a_body_of_its_own_keeps_its_motion() -> None:
    source = leaning(3.0)
    after = sway_hips(source, transfer(source, source.rig))
    np.testing.assert_allclose(after.hips, source.hips, atol=1e-12)
    np.testing.assert_allclose(after.rotations, source.rotations, atol=1e-12)


@pytest.mark.parametrize("frames", [1, 2, 3, 4])
def test_a_few_frames_are_no_motion(frames: int) -> None:
    source = leaning(3.0).frames(0, frames)
    before = transfer(source, with_trunk(1.5))
    after = sway_hips(source, before)
    np.testing.assert_allclose(after.hips[[0, -1]], before.hips[[0, -1]], atol=1e-12)


def test_the_centre_of_mass_is_the_reports() -> None:
    source = leaning(1.0)
    mass = human_mass(source.rig, *forward(from_canonical(source)))
    np.testing.assert_allclose(center_of_mass(source), mass.com, atol=1e-9)
