"""How alike the poses of a robot and of its source are."""

import numpy as np

from robots.model.motion import RobotMotion
from sim.report.pose_error import pose_error
from sim.trajectory import Subject
from spark.motion import Motion
from spark.rig.rig import Rig


def error_of(kind: str, motion: Motion, rig: Rig, result: RobotMotion) -> float | None:
    """The mean angle [rad] between the parts of a kind, of as many frames of both; None where they
    share none."""
    times = np.arange(len(motion)) * motion.frame_time
    found = pose_error(Subject(result.motion, result.robot.rig), Subject(motion, rig), times)
    return None if found is None else found.mean_of(kind)


def limb_error(motion: Motion, rig: Rig, result: RobotMotion) -> float:
    """The same of arms and legs, which all bodies have."""
    found = error_of("limb", motion, rig, result)
    assert found is not None
    return found
