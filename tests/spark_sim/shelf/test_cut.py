"""Long motions are cut where the body rests."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spark.motion import Motion
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec, quat_mul
from spark_sim.shelf.cut import pieces
from tests.helpers.stick import joint, standing, stick_rig


def waving(seconds: float, fps: float, rests: list[float], pause: float = 0.5) -> Motion:
    """The stick man swings an arm all the time, but for pauses around `rests` [s]."""
    rig = stick_rig()
    motion = standing(rig, int(seconds * fps), fps)
    times = np.arange(len(motion)) / fps
    moves = np.ones(len(motion))
    for rest in rests:
        moves[np.abs(times - rest) <= pause / 2] = 0.0
    phase = np.cumsum(moves) / fps
    turn = np.zeros((len(motion), 3))
    turn[:, 0] = np.sin(2 * np.pi * phase) + 0.7 * phase  # never slow but in a pause
    motion.rotations[:, joint(Role.LEFT_UPPER_ARM)] = quat_from_rotvec(3 * turn)
    return motion


@pytest.mark.parametrize("fps", [24.0, 120.0])
def test_cuts_lie_in_the_pauses(fps: float) -> None:
    rests = [7.0, 15.5, 23.0]
    motion = waving(30.0, fps, rests)
    found = pieces(motion, stick_rig(), 10.0)
    cuts = [start / fps for start, _ in found[1:]]
    assert len(cuts) == 3
    assert np.abs(np.array(cuts) - rests).max() < 0.25


@settings(max_examples=40)
@given(
    frames=st.integers(1, 900),
    fps=st.sampled_from([10.0, 30.0, 59.94]),
    longest=st.floats(0.5, 20.0),
)
def test_pieces_cover_the_motion_and_are_no_longer(frames: int, fps: float, longest: float) -> None:
    motion = standing(stick_rig(), frames, fps)
    found = pieces(motion, stick_rig(), longest)
    assert found[0][0] == 0
    assert found[-1][1] == frames
    assert all(one[1] == two[0] for one, two in pairwise(found))
    most = max(int(longest * fps + 1e-6), 1)
    sizes = [stop - start for start, stop in found]
    assert max(sizes) <= most
    assert min(sizes) >= (1 if most < 8 else most // 4 if len(sizes) > 1 else 1)


@pytest.mark.parametrize("fps", [24.0, 60.0, 120.0])
def test_a_broken_recording_is_cut_where_it_breaks(fps: float) -> None:
    """Rests or not, and though a piece might go on beyond it."""
    motion = waving(30.0, fps, [7.0, 15.5, 23.0])
    jump, flip = round(4.0 * fps), round(18.0 * fps)
    motion.root_pos[jump:, 0] += 1.7
    motion.rotations[flip:, 0] = quat_mul(
        quat_from_rotvec(np.array([0.0, 0.0, np.pi])), motion.rotations[flip:, 0]
    )
    found = pieces(motion, stick_rig(), 10.0)
    assert {jump, flip} < {start for start, _ in found}
    assert max(stop - start for start, stop in found) <= 10.0 * fps


def test_a_break_that_a_piece_does_not_reach_is_cut_next() -> None:
    """Though the body rests right before it."""
    motion = waving(20.0, 60.0, [9.9])
    motion.root_pos[610:, 0] += 1.7
    found = pieces(motion, stick_rig(), 10.0)
    assert 610 in {start for start, _ in found}
    assert min(stop - start for start, stop in found) >= 150


def test_a_short_recording_is_cut_where_it_breaks_too() -> None:
    motion = waving(8.0, 60.0, [])
    assert pieces(motion, stick_rig(), 10.0) == [(0, 480)]
    motion.root_pos[200:, 1] -= 1.0
    assert pieces(motion, stick_rig(), 10.0) == [(0, 200), (200, 480)]


def test_a_break_near_an_end_makes_no_scrap() -> None:
    """Of zeros for a third of a second, too, it is not cut twice."""
    motion = waving(8.0, 60.0, [])
    motion.root_pos[30:] += 1.0
    assert pieces(motion, stick_rig(), 10.0) == [(0, 480)]
    gone = waving(8.0, 60.0, [])
    gone.root_pos[:, :2] += 3.0
    gone.root_pos[240:260] = 0.0
    assert pieces(gone, stick_rig(), 10.0) == [(0, 260), (260, 480)]
