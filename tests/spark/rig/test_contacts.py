"""When feet stand and where the floor is: the same at every frame rate and for every size."""

from dataclasses import replace

import numpy as np
import pytest

from spark.demo.sample import sample_motion, sample_rig
from spark.io.recording import read_recording
from spark.kinematics import forward
from spark.rig.contacts import planted_feet, planted_points, speeds
from spark.rig.rig import understand
from tests.helpers.recordings import recordings


def test_speed_of_a_point_that_moves_evenly() -> None:
    time = np.arange(0, 1, 0.01)
    path = np.stack([0.3 * time, 0.4 * time, np.sin(time)], axis=1)
    assert np.allclose(speeds(path, 0.01), 0.5)
    assert speeds(path[:1], 0.01) == 0


def test_a_sliding_point_and_a_raised_one_are_not_planted() -> None:
    time = np.arange(0, 2, 1 / 60)
    points = np.zeros((len(time), 3, 3))
    points[:, 1, 0] = 0.3 * time
    points[:, 2, 2] = np.where(time < 1, 0.0, 0.1)
    planted = planted_points(points, 1 / 60, 1.75)
    assert planted[:, 0].all()
    assert not planted[:, 1].any()
    assert (planted[:, 2] == (time < 1)).all()


def test_a_foot_that_never_comes_down_does_not_stand() -> None:
    points = np.zeros((60, 2, 3))
    points[:, 1, 2] = 0.1  # as a shoe's thickness would be, or a block's
    assert planted_points(points, 1 / 60, 1.75).all()
    points[:, 1, 2] = 0.2
    planted = planted_points(points, 1 / 60, 1.75)
    assert planted[:, 0].all()
    assert not planted[:, 1].any()


def test_where_there_are_no_feet_none_stands() -> None:
    assert planted_points(np.zeros((60, 0, 3)), 1 / 60, 1.75).shape == (60, 0)


@pytest.mark.parametrize("size", [0.5, 2.0])
def test_a_body_of_another_size_stands_at_the_same_times(size: float) -> None:
    """Lengths and speeds grow with the body; time does not."""
    rig = sample_rig("walker")
    motion = sample_motion("walk", rig, 60.0)
    positions, _ = forward(motion)
    larger = replace(rig, hip_height=rig.hip_height * size)
    same = planted_feet(larger, positions * size, motion.frame_time)
    assert (same == planted_feet(rig, positions, motion.frame_time)).all()


@pytest.mark.parametrize(
    "path", recordings("cmu_asf/cmu_02_01.bvh", "cmu_expmap/test_walking_10.bvh")
)
def test_contacts_do_not_depend_on_the_frame_rate(path: object) -> None:
    motion = read_recording(str(path)).motion
    rig = understand(motion)
    positions, _ = forward(motion)
    all_frames = planted_feet(rig, positions, motion.frame_time)
    every_other = planted_feet(rig, positions[::2], 2 * motion.frame_time)
    assert (all_frames[::2] == every_other).mean() > 0.99
    assert 0.1 < all_frames.mean() < 0.9
