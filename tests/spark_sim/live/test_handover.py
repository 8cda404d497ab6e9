"""From one body to another the robot stands."""

import numpy as np

from robots.model.known import known
from robots.model.morphology import Morphology
from spark.kinematics import forward
from spark.rig.feet import sole_positions
from spark_sim.live.handover import Handover

EMBER, FPS = known("robot"), 60.0


def bent(robot: Morphology, angle: float) -> np.ndarray:
    """Both knees bent by so much [rad], hips and ankles by half of it, soles on the floor."""
    qpos = robot.to_qpos(robot.tpose.at(np.array([0])))[0]
    for name, share in (("hip_pitch", -0.5), ("knee", 1.0), ("ankle_pitch", -0.5)):
        for j, joint in enumerate(robot.joint_names):
            qpos[7 + j] += share * angle * (name in joint)
    qpos[2] -= lowest(robot, qpos)
    return qpos


def lowest(robot: Morphology, qpos: np.ndarray) -> float:
    pose = forward(robot.motion(robot.from_qpos(qpos[None]), 1.0))
    return float(min(sole_positions(sole, *pose)[..., 2].min() for sole in robot.soles))


def test_who_squats_comes_to_stand_on_the_floor() -> None:
    squat, stand = bent(EMBER, 1.8), bent(EMBER, 0.2)
    assert stand[2] > squat[2] + 0.1  # [m]
    stand[:2] += 3.0  # [m]
    handover = Handover(EMBER, FPS)
    handover.follow(squat)
    handover.begin()
    way = np.array([handover.follow(stand) for _ in range(40)])
    assert max(abs(lowest(EMBER, qpos)) for qpos in way) < 1e-6
    assert np.ptp(way[:, :2], axis=0).max() < 0.01
    np.testing.assert_allclose(way[-1, 2:], stand[2:])
    assert np.abs(np.diff(way, axis=0)).max() < 1.6 * 1.8 / 30  # an even way in 30 steps is 1
