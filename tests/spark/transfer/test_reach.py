"""Hips come down as far as feet out of reach need it, in time, and no further."""

from dataclasses import replace

import numpy as np
import pytest

from spark.demo.sample import sample_motion, sample_rig
from spark.rig.roles import Group
from spark.transfer.canonical import CanonicalMotion, canonical_positions, to_canonical
from spark.transfer.foot_lock import lock_feet
from spark.transfer.leg_ik import Leg, leg_of, move_ankles
from spark.transfer.reach import MAX_REACH, within_reach
from tests.helpers.stick import standing, stick_rig

LEG = 0.8  # [m] of the stick man, stretched out as he stands
FPS = 60.0
ALWAYS = np.array([[True]])  # one leg that stands in every frame


def stick() -> tuple[CanonicalMotion, Leg]:
    motion = to_canonical(standing(stick_rig(), 121, FPS), stick_rig())
    leg = leg_of(motion.rig.skeleton, motion.rig.roles.roles, Group.LEFT_LEG)
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
    other = leg_of(motion.rig.skeleton, motion.rig.roles.roles, Group.RIGHT_LEG)
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
