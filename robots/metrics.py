"""How good a motion on a robot is: the bars of the solver, measured on a clip.

What the plausibility report measures is taken from it, on the robot's own model. The rest looks at
what no report of one motion can see: what became of the source's swings, path and accelerations.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from robots.kinematics import forward_kinematics
from robots.model.motion import RobotMotion
from robots.solver.floor import sole_paths
from robots.solver.targets import targets_of
from robots.solver.touching import touches_of
from sim.report.assess import assess
from sim.report.clip_poses import pose_clip
from sim.report.derivatives import derivative
from sim.trajectory import Subject
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.feet import Side, sole_positions
from spark.rig.rig import Rig
from spark.transfer.canonical import CanonicalMotion, to_canonical
from spark.transfer.ground import Ground

DRAG_SPEED, DRAG_HEIGHT = 0.5, 0.01  # [m/s], [m] of a sole that is fast, and low: it drags
# [m/s], [m] of a standing toe of the source, whatever its size: the figures that other tools are
# compared by, apart from what the solver takes for a contact (`spark.rig.contacts`).
PLANTED_SPEED, PLANTED_HEIGHT = 0.15, 0.06
MAX_UNEVEN = 0.05  # [m] between the lowest heights of both feet: one may never come down
IN_AIR = 0.02  # [m] that a planted foot may be above the floor
AT_LIMIT = np.radians(0.5)
_STILL = 0.3  # [m/s²] of hips that don't move, against which all that do are thrown
_WINDOW = 0.05  # [s] before and after a frame over which accelerations are measured


@dataclass(frozen=True)
class RobotMetrics:
    """Shares are of frames [0, 1]; those of `source` beside them. `swing_clearance` and the
    accelerations (99th percentiles, of the middle of the hips, the centre of mass and the worst
    limb) are over the source's, scaled by the hips' heights; `rests` is of hands, knees and other
    parts that lie on the ground in the source. None where there is nothing to compare."""

    implausible: float
    implausible_source: float
    penetration: float
    floating: float
    floating_source: float
    skating: float
    skating_source: float
    root_wrench: float
    root_wrench_source: float
    swing_clearance: float | None
    dragging: float
    dragging_source: float
    hips_acceleration: float | None
    com_acceleration: float | None
    limb_acceleration: float | None
    heading_rad: float
    drift_m: float
    contact_f1: float | None
    sunk: float
    deepest_m: float
    in_air: float
    skate_m_s: float
    skate_source_m_s: float
    rests_in_air: float | None
    rests_slide_m_s: float | None
    limb_error_rad: float
    foot_error_rad: float | None
    hand_error_rad: float | None
    trunk_error_rad: float | None
    at_limit: float
    fastest_rad_s: float
    jerk_rad_s3: float
    self_collision: float
    over_torque: float | None


def measure(motion: Motion, rig: Rig, result: RobotMotion) -> RobotMetrics:
    """Of `result`, made from `motion` on `rig`, frame by frame."""
    robot, frame_time = result.robot, motion.frame_time
    source, own = Subject(motion, rig), Subject(result.motion, robot.rig, result.body)
    report = assess(own, source=source)
    assert report.source is not None
    assert report.drift is not None
    assert report.contacts is not None
    assert report.pose is not None
    pose, limbs = report.pose, report.pose.mean_of("limb")
    assert limbs is not None
    scale = robot.rig.hip_height / rig.hip_height
    positions, world = forward(motion)
    soles = {sole.side: sole_positions(sole, positions, world) for sole in rig.soles}
    theirs = _Soles(soles, report.source.ground, frame_time)
    ours = _Soles(_robot_soles(result), report.clip.ground, frame_time)
    planted = _planted(positions[:, rig.contact_joints], frame_time)[:, : len(robot.soles)]
    count = max(int(planted.sum()), 1)
    toes = positions[:, rig.contact_joints][:, : len(robot.soles)]
    own_poses, source_poses = pose_clip(own), pose_clip(source)
    swing, thrown = report.swing, scale * report.source.base_acceleration_p99
    angles, tree = result.coordinates.angles, robot.tree
    near = np.minimum(angles - tree.lower, tree.upper - angles) < AT_LIMIT
    jerk = np.diff(angles, 3, axis=0) / frame_time**3
    clip, beside = report.clip, report.source
    return RobotMetrics(
        implausible=clip.implausible_share,
        implausible_source=beside.implausible_share,
        penetration=clip.shares["penetration"],
        floating=clip.shares["floating"],
        floating_source=beside.shares["floating"],
        skating=clip.shares["skating"],
        skating_source=beside.shares["skating"],
        root_wrench=clip.shares["root_wrench"],
        root_wrench_source=beside.shares["root_wrench"],
        swing_clearance=None if swing is None else swing.clearance,
        dragging=ours.dragging,
        dragging_source=theirs.dragging,
        hips_acceleration=report.clip.base_acceleration_p99 / thrown if thrown > _STILL else None,
        com_acceleration=_over(own_poses.mass.com, source_poses.mass.com, scale, frame_time),
        limb_acceleration=None if report.limbs is None else report.limbs.ratio,
        heading_rad=float(np.abs(report.drift.heading).max()),
        drift_m=float(report.drift.distance.max()),
        contact_f1=report.contacts.f1,
        sunk=float((ours.lowest.min(axis=1) < -DRAG_HEIGHT).mean()),
        deepest_m=max(0.0, -float(ours.lowest.min())),
        in_air=float((planted & (ours.lowest > IN_AIR)).sum() / count),
        skate_m_s=float(ours.lowest_speed[planted].sum() / count),
        skate_source_m_s=float(_speed(toes, frame_time)[planted].sum() / count),
        **_resting(to_canonical(motion, rig), result),
        limb_error_rad=limbs,
        foot_error_rad=pose.mean_of("foot"),
        hand_error_rad=pose.mean_of("hand"),
        trunk_error_rad=pose.mean_of("trunk"),
        at_limit=float(near.any(axis=1).mean()),
        fastest_rad_s=float(np.abs(np.diff(angles, axis=0)).max(initial=0.0) / frame_time),
        jerk_rad_s3=float(np.sqrt(np.mean(jerk**2))) if len(jerk) else 0.0,
        self_collision=float(clip.self_penetration.mean()),
        over_torque=clip.overload_share,
    )


class _Soles:
    """Points of each foot's sole over time, by side, above the ground."""

    def __init__(
        self, points: Mapping[Side, Float[np.ndarray, "T _ 3"]], ground: Ground, frame_time: float
    ) -> None:
        speeds = [_speed(p, frame_time) for p in points.values()]
        heights = [ground.heights(p, [f"{side} foot"] * p.shape[1]) for side, p in points.items()]
        self.lowest = np.stack([h.min(axis=1) for h in heights], axis=1)
        at = [h.argmin(axis=1)[:, None] for h in heights]
        self.lowest_speed = np.stack(
            [np.take_along_axis(s, k, 1)[:, 0] for s, k in zip(speeds, at, strict=True)], axis=1
        )
        drags = [
            ((h < DRAG_HEIGHT) & (s > DRAG_SPEED)).any(axis=1)
            for h, s in zip(heights, speeds, strict=True)
        ]
        self.dragging = float(np.mean(drags))


def _robot_soles(result: RobotMotion) -> dict[Side, Float[np.ndarray, "T _ 3"]]:
    poses = forward_kinematics(result.robot.tree, result.coordinates)
    return {sole.side: sole_paths(result.robot, poses, sole) for sole in result.robot.soles}


def _resting(source: CanonicalMotion, result: RobotMotion) -> dict[str, float | None]:
    """Of the parts that rest in the source: the share of times at which the robot's is in the air,
    and how fast its lowest point then slides."""
    robot, targets = result.robot, targets_of(source, result.robot)
    poses = forward_kinematics(robot.tree, result.coordinates)
    in_air, speeds = [], []
    for k, role in enumerate(targets.part_roles):
        touch = touches_of(robot).get(role)
        if touch is not None:
            rests = targets.rests[:, k]
            in_air.append(touch.lowest(poses)[rests] > IN_AIR)
            speeds.append(_speed(touch.slid(poses), source.frame_time)[rests])
    if not sum(map(len, in_air)):
        return {"rests_in_air": None, "rests_slide_m_s": None}
    return {
        "rests_in_air": float(np.concatenate(in_air).mean()),
        "rests_slide_m_s": float(np.concatenate(speeds).mean()),
    }


def _over(
    ours: Float[np.ndarray, "T 3"],
    theirs: Float[np.ndarray, "T 3"],
    scale: float,
    frame_time: float,
) -> float | None:
    """The 99th percentile of an acceleration over the source's, scaled."""
    own, source = (
        float(np.percentile(np.linalg.norm(derivative(x, frame_time, 2, _WINDOW), axis=1), 99))
        for x in (ours, theirs)
    )
    return own / (scale * source) if source > 0 else None


def _planted(toes: Float[np.ndarray, "T F 3"], frame_time: float) -> Bool[np.ndarray, "T F"]:
    low = np.percentile(toes[..., 2], 1, axis=0)
    low = np.minimum(low, low.min(initial=np.inf) + MAX_UNEVEN)
    return (_speed(toes, frame_time) < PLANTED_SPEED) & (toes[..., 2] < low + PLANTED_HEIGHT)


def _speed(points: Float[np.ndarray, "T *n _"], frame_time: float) -> Float[np.ndarray, "T *n"]:
    """Along the floor [m/s]; a single frame stands still."""
    if len(points) < 2:
        return np.zeros(points.shape[:-1])
    speed: Float[np.ndarray, T * n] = np.linalg.norm(
        np.gradient(points[..., :2], frame_time, axis=0), axis=-1
    )
    return speed
