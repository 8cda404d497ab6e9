"""Hips come down as far as feet out of reach need it, in time, and no further; legs of feet that
swing stretch gently."""

from dataclasses import replace

import numpy as np
import pytest

from spark.demo.sample import sample_motion, sample_rig
from spark.rig.roles import Group, Role
from spark.rotation import quat_from_rotvec
from spark.transfer.canonical import CanonicalMotion, canonical_positions, to_canonical
from spark.transfer.foot_lock import lock_feet
from spark.transfer.leg_ik import Leg, leg_of, move_ankles
from spark.transfer.reach import MAX_REACH, stretch, swing_gently, unfolded, within_reach
from tests.helpers.stick import joint, standing, stick_rig, without

LEG = 0.8  # [m] of the stick man, stretched out as he stands
FPS = 60.0
ALWAYS = np.array([[True]])  # one leg that stands in every frame
NEVER = np.zeros((1, 121), dtype=bool)


def stick() -> tuple[CanonicalMotion, Leg]:
    motion = to_canonical(standing(stick_rig(), 121, FPS), stick_rig())
    leg = leg_of(motion.rig, Group.LEFT_LEG)
    assert leg is not None
    return motion, leg


def stepping(wide: float) -> np.ndarray:
    """One step to the side [m], from 0.9 to 1.1 s."""
    move = np.zeros((121, 3))
    move[54:67, 1] = wide
    return move


@pytest.mark.parametrize("wide", [0.1, 0.2, 0.3])
def test_the_hips_come_down_to_a_wide_step(wide: float) -> None:
    motion, leg = stick()
    lower, moves = within_reach(motion, [(leg, stepping(wide))], ALWAYS)
    down = motion.hips - lower.hips
    assert np.abs(down[:, :2]).max() == 0
    # By Pythagoras, of a leg that may stay as stretched as it was.
    needed = LEG - np.sqrt(LEG**2 - wide**2)
    assert down[60, 2] == pytest.approx(needed, rel=1e-9)
    assert down[54:67, 2].min() > needed - 1e-9
    assert down[:36].max() == down[86:].max() == 0
    # It takes 0.3 s: a drop at once would be as fast as a frame is short.
    assert np.abs(np.diff(down[:, 2])).max() * FPS < 1.01 * needed / 0.3
    ankle = canonical_positions(move_ankles(lower, moves))[:, leg.foot]
    wanted = canonical_positions(motion)[:, leg.foot] + stepping(wide)
    assert np.linalg.norm(ankle - wanted, axis=1).max() < 2 * (1 - MAX_REACH) * LEG


def crouched(stretched: float) -> tuple[CanonicalMotion, Leg]:
    """The stick man with his left ankle so near to the hip joint [legs], at about 1 s."""
    motion, leg = stick()
    move = np.zeros((121, 3))
    move[54:67, 2] = LEG * (1 - stretched)
    return move_ankles(motion, [(leg, move)]), leg


def raised(up: float) -> np.ndarray:
    """An ankle's move [m], from 0.9 to 1.1 s."""
    move = np.zeros((121, 3))
    move[54:67, 2] = up
    return move


@pytest.mark.parametrize(("theirs", "nearer"), [(0.5, 0.2), (0.4, 0.3), (0.25, 0.2), (0.2, 0.15)])
def test_the_hips_rise_where_a_leg_would_fold_flat(theirs: float, nearer: float) -> None:
    """It folds further than the source's, and no further than until its thigh lies on its calf."""
    motion, leg = crouched(theirs)
    stretches = [stretch(motion, Group.LEFT_LEG)]
    higher, moves = unfolded(motion, [(leg, raised(nearer * LEG))], stretches, ALWAYS)
    folded = stretch(move_ankles(higher, moves), Group.LEFT_LEG)[54:67]
    assert folded.min() > min(0.25, theirs) - 1e-3
    assert folded.max() < theirs + 1e-3
    up = higher.hips - motion.hips
    assert np.abs(up[:, :2]).max() == up[:36].max() == up[86:].max() == 0
    assert np.abs(np.diff(up[:, 2])).max() * FPS < 1.01 * nearer * LEG / 0.3
    ankle = canonical_positions(move_ankles(higher, moves))[:, leg.foot]
    wanted = canonical_positions(motion)[:, leg.foot] + raised(nearer * LEG)
    assert np.linalg.norm(ankle - wanted, axis=1)[54:67].max() < 1e-3


def test_a_leg_that_folds_little_or_swings_raises_no_hips() -> None:
    motion, leg = crouched(0.8)
    stretches = [stretch(motion, Group.LEFT_LEG)]
    higher, _ = unfolded(motion, [(leg, raised(0.05 * LEG))], stretches, ALWAYS)
    assert np.abs(higher.hips - motion.hips).max() < 0.003 * LEG
    higher, _ = unfolded(motion, [(leg, raised(0.5 * LEG))], stretches, NEVER)
    assert higher is motion


def test_a_foot_that_swings_is_let_go_of() -> None:
    motion, leg = stick()
    stands = np.ones((1, 121), dtype=bool)
    stands[:, 54:67] = False
    same, _ = within_reach(motion, [(leg, stepping(0.3))], stands)
    np.testing.assert_array_equal(same.hips, motion.hips)


def test_a_foot_beyond_all_reach_is_let_go_of() -> None:
    motion, leg = stick()
    lower, _ = within_reach(motion, [(leg, stepping(2.0))], ALWAYS)
    assert (motion.hips - lower.hips)[:, 2].max() == pytest.approx(0.1 * motion.rig.hip_height)


def test_feet_within_reach_leave_the_hips_where_they_are() -> None:
    motion, leg = stick()
    move = np.tile([0.02, 0.0, 0.05], (121, 1))
    same, moves = within_reach(motion, [(leg, move)], ALWAYS)
    assert same is motion
    assert moves[0][1] is move
    for name in ("walk", "squat"):
        own = to_canonical(sample_motion(name, sample_rig("walker"), 60.0), sample_rig("walker"))
        np.testing.assert_array_equal(lock_feet(own, own).hips, own.hips)


def test_the_frame_rate_does_not_matter() -> None:
    motion, leg = stick()
    twice = to_canonical(standing(stick_rig(), 241, 2 * FPS), stick_rig())
    drops = [
        (m.hips - within_reach(m, [(leg, step[: len(m)])], ALWAYS)[0].hips)[:, 2]
        for m, step in ((motion, stepping(0.2)), (twice, np.repeat(stepping(0.2), 2, 0)))
    ]
    np.testing.assert_allclose(drops[1][::2], drops[0], atol=0.004)


def test_the_higher_of_two_needs_counts() -> None:
    motion, leg = stick()
    other = leg_of(motion.rig, Group.RIGHT_LEG)
    assert other is not None
    moves = [(leg, stepping(0.1)), (other, -stepping(0.3))]
    both = within_reach(motion, moves, np.repeat(ALWAYS, 2, axis=0))[0]
    one = within_reach(motion, moves[1:], ALWAYS)[0]
    np.testing.assert_array_equal(both.hips, one.hips)


def test_a_body_without_frames_to_spare() -> None:
    motion, leg = stick()
    short = replace(motion, rotations=motion.rotations[:2], hips=motion.hips[:2])
    lower, _ = within_reach(short, [(leg, np.tile([0.0, 0.2, 0.0], (2, 1)))], ALWAYS)
    needed = LEG - np.sqrt(LEG**2 - 0.2**2)
    np.testing.assert_allclose((short.hips - lower.hips)[:, 2], needed)


def stretched(motion: CanonicalMotion, leg: Leg, to: np.ndarray) -> np.ndarray:
    """What moves a leg's ankle so that it is so many lengths from the hip joint [m]."""
    at = canonical_positions(motion, [leg.upper_leg, leg.foot])
    return (to / stretch(motion, Group.LEFT_LEG) - 1)[:, None] * (at[:, 1] - at[:, 0])


def knee(motion: CanonicalMotion, leg: Leg) -> np.ndarray:
    """How far it is bent [rad]."""
    at = canonical_positions(motion, list(leg[:3]))
    thigh, shank = np.diff(at, axis=1).transpose(1, 0, 2)
    sizes = np.linalg.norm(thigh, axis=1) * np.linalg.norm(shank, axis=1)
    return np.arccos(np.clip((thigh * shank).sum(axis=1) / sizes, -1, 1))


@pytest.mark.parametrize(("theirs", "wanted"), [(0.9, 0.95), (0.9, 1.0), (0.9, 1.3), (0.5, 0.9)])
def test_a_leg_in_the_air_stretches_by_a_part_of_what_is_left(theirs: float, wanted: float) -> None:
    motion, leg = stick()
    moves = [(leg, stretched(motion, leg, np.full(121, wanted)))]
    gentle = swing_gently(motion, moves, [np.full(121, theirs)], NEVER)
    left = (1 - theirs) * np.exp(-(wanted - theirs) / (1 - theirs))
    got = stretch(move_ankles(motion, gentle), Group.LEFT_LEG)
    np.testing.assert_allclose(got, 1 - left, atol=1e-3)


def test_a_leg_that_stretches_no_further_than_the_source_s_goes_where_it_should() -> None:
    motion, leg = stick()
    for theirs, wanted in ((0.9, 0.9), (0.9, 0.6), (1.0, 1.0), (1.1, 1.05)):
        move = stretched(motion, leg, np.full(121, wanted))
        [(_, same)] = swing_gently(motion, [(leg, move)], [np.full(121, theirs)], NEVER)
        np.testing.assert_array_equal(same, move)


def test_a_knee_straightens_gently_on_the_way_to_a_place_out_of_reach() -> None:
    """The source's leg stretches from .7 to .95 of its length and bends again within a second, the
    target's would be a tenth longer."""
    motion, leg = stick()
    theirs = 0.825 + 0.125 * np.sin(2 * np.pi * np.arange(121) / FPS)
    there = [(leg, stretched(motion, leg, 1.1 * theirs))]
    quickest = [
        np.abs(np.diff(knee(move_ankles(motion, moves), leg))).max() * FPS
        for moves in (
            [(leg, stretched(motion, leg, theirs))],
            there,
            swing_gently(motion, there, [theirs], NEVER),
        )
    ]
    assert quickest[1] > 1.9 * quickest[0]
    assert quickest[2] < 1.3 * quickest[0]


def test_held_feet_leave_a_raised_knee_bent() -> None:
    """The left leg is kicked forwards, at .9 of its length; the target would stretch it out."""
    motion = standing(stick_rig(), 121, FPS)
    for part, bend in (("upper_leg", -2.02), ("lower_leg", 0.9)):
        turn = quat_from_rotvec(np.array([0.0, bend, 0.0]))
        motion.rotations[:, joint(Role(f"left_{part}"))] = turn
    source, leg = to_canonical(motion, stick_rig()), stick()[1]
    assert stretch(source, Group.LEFT_LEG)[0] == pytest.approx(np.cos(0.45), abs=0.01)
    straight = move_ankles(source, [(leg, stretched(source, leg, np.full(121, 1.0)))])
    held = lock_feet(source, straight)
    assert knee(straight, leg).max() < 0.1 < 0.4 < knee(held, leg).min()


def test_a_foot_that_rolls_off_far_behind_leaves_the_knee_bent() -> None:
    """A squat over the right sole and the left toes, the leg at .85 of its length; the target's
    foot is 0.3 m further behind, and would ask for .95 of it."""
    motion = standing(stick_rig(), 121, FPS)
    bends = {"right": (-0.5, 1.0, -0.5), "left": (-0.1, 1.1, -0.5)}
    for side, angles in bends.items():
        for part, bend in zip(("upper_leg", "lower_leg", "foot"), angles, strict=True):
            turn = quat_from_rotvec(np.array([0.0, bend, 0.0]))
            motion.rotations[:, joint(Role(f"{side}_{part}"))] = turn
    source, leg = to_canonical(motion, stick_rig()), stick()[1]
    assert stretch(source, Group.LEFT_LEG)[0] == pytest.approx(0.853, abs=0.001)
    held = lock_feet(source, move_ankles(source, [(leg, np.tile([-0.3, 0, 0], (121, 1)))]))
    assert 0.7 < knee(held, leg).min() < knee(source, leg).min()


def test_a_foot_that_stands_is_not_let_go_of() -> None:
    motion, leg = stick()
    stands = NEVER.copy()
    stands[:, 40:80] = True
    move = stretched(motion, leg, np.full(121, 1.1))
    [(_, gentle)] = swing_gently(motion, [(leg, move)], [np.full(121, 0.8)], stands)
    away = np.linalg.norm(gentle - move, axis=1)
    assert away[40:80].max() == 0
    np.testing.assert_allclose(away[:34], away[0])
    assert (np.diff(away[79:86]) >= 0).all()


def test_a_leg_without_a_knee_says_nothing() -> None:
    rig = without(stick_rig(), Role.LEFT_LOWER_LEG)
    motion = to_canonical(standing(rig, 121, FPS), rig)
    theirs = stretch(motion, Group.LEFT_LEG)
    whole, leg = stick()
    for wanted in (0.7, 1.0):
        move = stretched(whole, leg, np.full(121, wanted))
        [(_, same)] = swing_gently(whole, [(leg, move)], [theirs], NEVER)
        np.testing.assert_array_equal(same, move)
