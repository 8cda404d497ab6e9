"""A loop stays one on a robot: its last frame is its first one, further on."""

import numpy as np

from robots.registry import find
from robots.solver.solve import retarget
from spark.demo import gait
from spark.demo.sample import sample_rig
from spark_sim.loading import load_robot

FPS = 60.0


def test_a_stride_closes_on_a_robot() -> None:
    rig, robot = sample_rig("walker"), load_robot(find("robot")).on_robot.robot
    # One that begins in the middle of a step: to come to rest there, a body would need another one.
    count = round(FPS * gait.stride_time(rig)) + 1
    stride = gait.walk(rig, FPS).frames(20, 20 + count)
    result = retarget(stride, robot)
    assert len(result) == count
    q = result.coordinates
    assert np.abs(q.angles[-1] - q.angles[0]).max() < np.radians(1.0)
    speeds = np.diff(q.angles, axis=0) * FPS
    assert np.abs(speeds[0] - speeds[-1]).max() < 1.0
    ahead = (stride.hips[-1] - stride.hips[0]) * robot.rig.hip_height / rig.hip_height
    np.testing.assert_allclose(q.pos[-1] - q.pos[0], ahead, atol=0.005)
