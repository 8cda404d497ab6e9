"""Long motions are cut where the body rests."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spark.motion import Motion
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec
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
