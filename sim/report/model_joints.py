"""A model's own joints: how far beyond their limits, and how fast they move."""

import numpy as np

from sim.body.mj_joints import BALL, HINGE, hinges_and_balls, joint_name
from sim.report.derivatives import derivative
from sim.report.limits import LimitExcess
from sim.report.smoothness import Rates, angular_rates, turns_between
from sim.report.thresholds import PLAUSIBILITY
from sim.trajectory import ModelTrajectory
from spark.rotation import quat_normalize, rotvec_from_quat

# [rad]: files round, so that a joint on its limit may be written this far beyond it.
_FILE_ROUNDING = 1e-4


def model_limit_excess(body: ModelTrajectory) -> tuple[LimitExcess, ...]:
    """How far each hinge is beyond its range in the file, and each ball beyond its cone.

    Joints without limits are left out.
    """
    model, limits, excesses = body.model, PLAUSIBILITY, []
    for joint in hinges_and_balls(body.model, body.root):
        if not model.jnt_limited[joint]:
            continue
        low, high = model.jnt_range[joint]
        name, address = joint_name(model, joint), int(model.jnt_qposadr[joint])
        if int(model.jnt_type[joint]) == HINGE:
            angle = body.qpos[:, address]
            beyond, width = np.stack([low - angle, angle - high], axis=1), high - low
            movements: tuple[str, ...] = ("turns back", "turns on")
        else:
            rotvec = rotvec_from_quat(quat_normalize(body.qpos[:, address : address + 4]))
            beyond, width = np.linalg.norm(rotvec, axis=1, keepdims=True) - high, 2 * high
            movements = ("turns",)
        margin = min(limits.limit_margin, limits.limit_margin_share * float(width))
        excesses.append(LimitExcess(name, beyond - _FILE_ROUNDING, movements, margin))
    return tuple(excesses)


def model_joint_rates(body: ModelTrajectory, frame_time: float, window: float) -> Rates:
    """The rates of the model's own hinges and balls."""
    model, joints = body.model, hinges_and_balls(body.model, body.root)
    hinges = [j for j in joints if int(model.jnt_type[j]) == HINGE]
    balls = [j for j in joints if int(model.jnt_type[j]) == BALL]
    angles = body.qpos[:, model.jnt_qposadr[hinges]]
    velocity = derivative(angles, frame_time, 1, window)
    jerk = derivative(velocity, frame_time, 2, window)
    rotations = quat_normalize(body.qpos[:, model.jnt_qposadr[balls][:, None] + np.arange(4)])
    ball_speed, ball_jerk = angular_rates(rotations, frame_time, window)
    turns = np.abs(np.diff(angles, axis=0, prepend=angles[:1]))
    return Rates(
        tuple(joint_name(model, joint) for joint in (*hinges, *balls)),
        np.concatenate([np.abs(velocity), ball_speed], axis=1),
        np.concatenate([np.abs(jerk), ball_jerk], axis=1),
        np.concatenate([turns, turns_between(rotations)], axis=1),
    )
