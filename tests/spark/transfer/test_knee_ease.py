"""Knees hardly notice a sole that trembles where they are nearly straight, and follow where they
are bent; a foot that stands is not pushed along the floor."""

from dataclasses import replace

import numpy as np
import pytest

from spark.demo.sample import MOTIONS, sample_motion, sample_rig
from spark.kinematics import forward
from spark.rig.feet import sole_positions
from spark.rig.roles import Group, Role
from spark.rotation import quat_from_rotvec
from spark.transfer.analytic import transfer
from spark.transfer.canonical import (
    CanonicalMotion,
    canonical_positions,
    from_canonical,
    to_canonical,
)
from spark.transfer.foot_lock import lock_feet
from spark.transfer.knee_ease import ease_knees, smoothest
from spark.transfer.leg_ik import Leg, leg_of, move_ankles
from spark.transfer.reach import stretch
from tests.helpers.stick import joint, standing, stick_rig

FRAMES, FPS = 121, 60.0
STANDS = np.ones((1, FRAMES), dtype=bool)


def squatting(bend: float, foot: np.ndarray | float = 0.0) -> tuple[CanonicalMotion, Leg]:
    """The stick man with both knees bent by so much, and his feet pitched down from level [rad]."""
    motion = standing(stick_rig(), FRAMES, FPS)
    motion.root_pos[:, 2] -= 0.8 * (1 - np.cos(bend / 2))
    pitch = np.zeros((FRAMES, 3))
    pitch[:, 1] = foot
    for side in ("left", "right"):
        for part, turn in (("upper_leg", -bend / 2), ("lower_leg", bend), ("foot", -bend / 2)):
            by = quat_from_rotvec(np.array([0.0, turn, 0.0]) + (part == "foot") * pitch)
            motion.rotations[:, joint(Role(f"{side}_{part}"))] = by
    canonical = to_canonical(motion, stick_rig())
    leg = leg_of(canonical.rig, Group.LEFT_LEG)
    assert leg is not None
    return canonical, leg


def knees(motion: CanonicalMotion) -> np.ndarray:
    """How far both are bent [degrees]."""
    roles = motion.rig.roles
    joints = [
        roles.require(Role(f"{side}_{part}"))
        for side in ("left", "right")
        for part in ("upper_leg", "lower_leg", "foot")
    ]
    at = canonical_positions(motion, joints).reshape(len(motion), 2, 3, 3)
    thigh, shank = np.diff(at, axis=2).transpose(2, 0, 1, 3)
    sizes = np.linalg.norm(thigh, axis=-1) * np.linalg.norm(shank, axis=-1)
    return np.degrees(np.arccos(np.clip((thigh * shank).sum(-1) / sizes, -1, 1)))


def raised(bend: float, up: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The knee of a leg [degrees] whose ankle is to be `up` [m] higher, exactly and eased."""
    motion, leg = squatting(bend)
    moves = [(leg, up[:, None] * np.array([0.0, 0.0, 1.0]))]
    eased = ease_knees(motion, moves, [stretch(motion, Group.LEFT_LEG)], STANDS)
    exact, smooth = (knees(move_ankles(motion, each))[:, 0] for each in (moves, eased))
    return exact, smooth


@pytest.mark.parametrize("up", [0.02, 0.06])
def test_a_sole_that_jumps_does_not_snap_a_knee_that_is_nearly_straight(up: float) -> None:
    step = up * (np.arange(FRAMES) >= 60)
    exact, smooth = raised(0.1, step)
    assert np.abs(np.diff(exact)).max() > 15
    assert np.abs(np.diff(smooth)).max() < 0.2 * np.abs(np.diff(exact)).max()
    np.testing.assert_allclose(smooth[[0, -1]], exact[[0, -1]], atol=0.5)


def test_of_a_tremble_of_a_frame_less_than_half_is_left() -> None:
    exact, smooth = raised(0.1, 0.02 * (np.arange(FRAMES) == 60))
    assert np.ptp(exact) > 15
    assert np.ptp(smooth) < 0.5 * np.ptp(exact)


def test_a_bent_knee_does_what_its_sole_asks_for() -> None:
    """A sole that goes up and down by 4 cm within 0.4 s."""
    up = 0.02 * (1 - np.cos(2 * np.pi * np.clip((np.arange(FRAMES) - 48) / 24, 0, 1)))
    exact, smooth = raised(1.4, up)
    np.testing.assert_allclose(smooth, exact, atol=0.03 * np.ptp(exact))


def test_knees_that_are_as_the_source_s_stay_so() -> None:
    """Whatever these do: only what is added is eased."""
    motion, leg = squatting(0.0)
    bend = 0.5 + 0.4 * (np.arange(FRAMES) > 60)
    far = np.cos(bend / 2)
    at = canonical_positions(motion, [leg.upper_leg, leg.foot])
    move = (far / stretch(motion, Group.LEFT_LEG) - 1)[:, None] * (at[:, 1] - at[:, 0])
    [(_, same)] = ease_knees(motion, [(leg, move)], [far], STANDS)
    np.testing.assert_allclose(same, move, atol=1e-9)


def test_a_foot_that_stands_is_only_raised_and_lowered() -> None:
    motion, leg = squatting(0.2)
    jump = np.arange(FRAMES)[:, None] >= 60
    move = jump * np.array([0.05, 0.03, 0.04])
    theirs = [stretch(motion, Group.LEFT_LEG)]
    [(_, stood)] = ease_knees(motion, [(leg, move)], theirs, STANDS)
    np.testing.assert_allclose((stood - move)[:, :2], 0, atol=1e-12)
    [(_, swung)] = ease_knees(motion, [(leg, move)], theirs, ~STANDS)
    at = canonical_positions(motion, [leg.upper_leg, leg.foot])
    goal = at[:, 1] - at[:, 0] + move
    np.testing.assert_allclose(np.cross(swung - move, goal), 0, atol=1e-12)
    assert np.abs(stood - move)[:, 2].max() > 0.001 < np.linalg.norm(swung - move, axis=1).max()


def test_the_curve_has_the_least_sum() -> None:
    rng = np.random.default_rng(0)
    wanted, weights = rng.normal(size=40), rng.random(40) + 0.1

    def cost(curve: np.ndarray) -> float:
        off, bends = weights * (curve - wanted), 2.0**2 * np.diff(curve, 2)
        return float((off**2).sum() + (bends**2).sum())

    curve = smoothest(wanted, weights, 2.0)
    assert cost(curve) < cost(wanted)
    for _ in range(20):
        other = 1e-3 * rng.normal(size=40)
        assert cost(curve) < min(cost(curve + other), cost(curve - other))


def test_a_straight_curve_stays_whatever_counts_of_it() -> None:
    line = 3.0 - 0.1 * np.arange(30)
    weights = np.random.default_rng(1).random(30) + 0.05
    np.testing.assert_allclose(smoothest(line, weights, 5.0), line)
    for short in (line[:1], line[:2]):
        np.testing.assert_array_equal(smoothest(short, weights[: len(short)], 5.0), short)


def test_the_frame_rate_does_not_matter() -> None:
    at = np.arange(241) / 240
    bump = np.exp(-(((at - 0.5) / 0.05) ** 2))
    slow, fast = smoothest(bump[::2], np.ones(121), 6.0), smoothest(bump, np.ones(241), 12.0)
    assert bump.max() - fast.max() > 0.1
    np.testing.assert_allclose(slow, fast[::2], atol=0.01)


def long_soles(motion: CanonicalMotion) -> CanonicalMotion:
    """The motion on feet half as long again."""
    rig = motion.rig
    offsets, ends = rig.skeleton.offsets.copy(), rig.skeleton.end_offsets.copy()
    for role in (Role.LEFT_TOE, Role.RIGHT_TOE):
        offsets[joint(role), 0] *= 1.5
    ends[:2] *= 1.5
    skeleton = replace(rig.skeleton, offsets=offsets, end_offsets=ends)
    return transfer(motion, replace(rig, skeleton=skeleton))


def test_feet_seen_to_turn_within_a_frame_do_not_snap_knees() -> None:
    """On straight legs, 15 degrees onto the toes and back, for a second and for a frame: on longer
    feet that asks for some centimetres. None of the sole is in the floor, as none was."""
    pitch = 0.26 * ((np.arange(FRAMES) > 20) & (np.arange(FRAMES) < 80))
    pitch[100] = 0.26
    source, _ = squatting(0.15, pitch)
    up = 0.14 * np.sin(pitch)
    source = replace(source, hips=source.hips + up[:, None] * np.array([0.0, 0.0, 1.0]))
    held = lock_feet(source, long_soles(source))
    assert np.abs(np.diff(knees(source), axis=0)).max() < 0.1
    assert np.abs(np.diff(knees(held), axis=0)).max() < 8
    positions, world = forward(from_canonical(held))
    low = min(sole_positions(s, positions, world)[..., 2].min() for s in held.rig.soles)
    assert low - held.floor_z > -0.01


@pytest.mark.parametrize("name", MOTIONS)
def test_legs_as_long_as_the_source_s_bend_as_these(name: str) -> None:
    own = to_canonical(sample_motion(name, sample_rig("walker"), 60.0), sample_rig("walker"))
    assert np.abs(knees(lock_feet(own, own)) - knees(own)).max() < 6
