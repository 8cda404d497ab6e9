"""A stream's first answers: from a pose at rest to a walk, without a hop."""

import numpy as np
import pytest

from robots.kinematics import forward_kinematics
from robots.model.known import known
from robots.solver.footprints import points_of
from robots.stream.frame_targets import LATENCY, Frame, ground_of
from robots.stream.stream import Stream
from spark.demo.sample import sample_motion, sample_rig
from spark.transfer.canonical import to_canonical

FPS = 60.0
RIG, EMBER = sample_rig("walker"), known("robot")
WALK = sample_motion("walk", RIG, FPS).frames(0, 90)


def said(first: int, missing: int = 0) -> np.ndarray:
    """Of the walk from a frame on, so many missing after it."""
    live = Stream(RIG, EMBER, 1 / FPS, ground_of(to_canonical(WALK, RIG), EMBER))
    frames = [first, *range(first + 1 + missing, first + 31 + missing)]
    return np.array([live.step(Frame(WALK.root_pos[t], WALK.rotations[t])) for t in frames])


@pytest.mark.parametrize("first", [10, 22, 36, 47])
def test_who_walks_already_begins_without_a_hop(first: int) -> None:
    height = said(first)[:, 2]
    begins, goes_on = height[: LATENCY + 6], height[LATENCY + 6 :]
    hop, usual = (np.abs(np.diff(z, 2)).max() * FPS**2 for z in (begins, goes_on))  # [m/s²]
    assert hop < max(1.5 * usual, 10.0)


@pytest.mark.parametrize("first", [10, 22, 36, 47])
def test_who_walks_already_is_joined_from_rest(first: int) -> None:
    """No base and no hinge is as fast as a walk's within a frame; after 0.3 s it is where one who
    has walked for longer is."""
    qpos, longer = said(first), said(first - 10)
    push = np.abs(np.diff(qpos, 2, axis=0)) * FPS**2
    assert push[: LATENCY + 2, :2].max() < 10.0  # [m/s²]
    assert push[: LATENCY + 2, 7:].max() < 100.0  # [rad/s²]
    np.testing.assert_allclose(qpos[20, :3], longer[30, :3], atol=0.03)
    np.testing.assert_allclose(qpos[20, 7:], longer[30, 7:], atol=0.1)


@pytest.mark.parametrize("missing", [4, 10])
def test_a_second_frame_that_is_late_throws_no_one(missing: int) -> None:
    """It is a tenth of a second until the next frame, and those come evenly: the robot goes on
    from where it waits, over its soles, to where the person is."""
    late, even = said(20, missing), said(21 + missing)
    speed, usual = (
        np.linalg.norm(np.diff(qpos[:, :2], axis=0), axis=1).max() * FPS for qpos in (late, even)
    )
    assert speed < usual + 0.8  # [m/s]
    np.testing.assert_allclose(late[-1, :2], even[-2, :2], atol=0.02)
    q = EMBER.from_qpos(late)
    tree_poses = forward_kinematics(EMBER.tree, q)
    soles = np.array([points_of(EMBER, tree_poses, sole)[:, 2].min(0) for sole in EMBER.soles])
    assert soles.min() > -0.01  # [m]
