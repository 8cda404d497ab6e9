"""A posed clip measured: all that a report says of a clip by itself."""

import numpy as np

from sim.report.clip_metrics import ClipMetrics
from sim.report.clip_poses import ClipPoses
from sim.report.derivatives import derivative
from sim.report.limb_ends import limb_ends
from sim.report.limits import limit_excess
from sim.report.measures import floating, horizontal_speed, penetration_depth, windowed_min
from sim.report.model_joints import model_joint_rates, model_limit_excess
from sim.report.nearest import nearest_to
from sim.report.self_penetration import capsules, self_penetration
from sim.report.smoothness import joint_rates
from sim.report.support import support_of
from sim.report.thresholds import PLAUSIBILITY
from sim.report.torque import JointTorque, joint_torques
from spark.constants import GRAVITY
from spark.transfer.ground import Ground


def measure(poses: ClipPoses, ground: Ground) -> ClipMetrics:
    """The measures of a posed clip over some ground."""
    thresholds = PLAUSIBILITY.scaled(poses.rig.hip_height)
    frame_time, window = poses.motion.frame_time, thresholds.window
    poses = nearest_to(poses, ground)
    support = support_of(poses, ground, thresholds)
    corners = len(support.feet)
    inside = np.concatenate([poses.part_points, poses.finger_points], axis=1)
    heights = [support.heights[:, :corners], ground.heights(inside)]
    depth = penetration_depth(np.concatenate(heights, axis=1))
    clearance = support.heights.min(axis=1)
    acceleration = derivative(poses.mass.com[:, 2], frame_time, 2, window)
    # The window smears take-off and landing over itself.
    fall_error = windowed_min(np.abs(acceleration + GRAVITY), frame_time, window)
    limbs = limb_ends(poses.rig, poses.positions, poses.rotations)
    bodies = np.concatenate([poses.hips[:, None], limbs.places], axis=1)
    thrown = np.linalg.norm(derivative(bodies, frame_time, 2, window), axis=-1)
    feet = support.corners_of
    middles = np.stack([poses.corners[:, own].mean(axis=1) for own in feet.values()], axis=1)
    skates = support.skating()
    wrench = support.unexplained_wrench()
    if poses.body is None or poses.model_poses is None:
        limits = limit_excess(poses.since_tpose, poses.rig)
        pairs, self_depth = self_penetration(capsules(poses))
        rates = joint_rates(poses.rotations, poses.rig, frame_time, window)
        torques: tuple[JointTorque, ...] = ()
        self_bound = thresholds.self_penetration
    else:
        limits = model_limit_excess(poses.body)
        pairs, self_depth = poses.model_poses.pairs, poses.model_poses.depth
        rates = model_joint_rates(poses.body, frame_time, window)
        self_bound = thresholds.shape_penetration
        torques = joint_torques(
            poses.body,
            frame_time,
            window,
            support.arms + poses.mass.com[:, None],
            poses.carriers,
            support.touching,
            thresholds.friction,
            support.length,
        )
    return ClipMetrics(
        frame_time=frame_time,
        ground=ground,
        thresholds=thresholds,
        flags={
            "penetration": depth.max(axis=1) > thresholds.penetration,
            "floating": floating(clearance, fall_error, thresholds.floating, thresholds.free_fall),
            "skating": np.any(skates, axis=1),
            "root_wrench": (wrench[:, 0] > thresholds.wrench_force)
            | (wrench[:, 1] > thresholds.wrench_torque),
        },
        depth=depth,
        depth_names=(*poses.corner_feet, *poses.part_names, *poses.finger_hands),
        clearance=clearance,
        corner_skates=skates,
        corner_speeds=support.speeds[:, :corners],
        corner_feet=poses.corner_feet,
        standing=support.standing(),
        sole_heights=np.stack(
            [support.heights[:, own].min(axis=1) for own in feet.values()], axis=1
        ),
        sole_speeds=horizontal_speed(middles, frame_time, window),
        base_acceleration=thrown[:, 0],
        limb_names=limbs.names,
        limb_lengths=limbs.lengths,
        limb_acceleration=thrown[:, 1:],
        torques=torques,
        unexplained_wrench=wrench,
        imbalance=support.imbalance(),
        limits=limits,
        self_pairs=pairs,
        self_depth=self_depth,
        self_bound=self_bound,
        joint_names=rates.names,
        joint_speed=rates.speed,
        joint_jerk=rates.jerk,
        joint_turns=rates.turns,
    )
