"""What couples the frames of a robot's trajectory: bounded accelerations, jerk and speed.

The weights and limits are in `robots.solver.weights`.
"""

import numpy as np
from jaxtyping import Float
from scipy.ndimage import uniform_filter1d

from robots.coupling import PointAcceleration, Smoothness, second_differences
from robots.kinematics import forward_kinematics
from robots.model.morphology import Morphology
from robots.solver.block import Block
from robots.solver.dynamics import center_of_mass, com_jacobian
from robots.solver.limb_jerk import JERK_WINDOW, limb_dofs
from robots.solver.weights import (
    AVOIDANCE_CUTOFF,
    JERK_SHARE,
    LEG_SHARE,
    MAX_HINGE_SPEED,
    MAX_JERK,
    SMOOTH_CUTOFF,
    W_COM_ACCELERATION,
    W_HIPS_POSITION,
    W_OVERSPEED,
    W_ROTATION,
    per_metre,
)
from robots.tree import Coordinates
from spark.rotation import quat_conj, quat_mul, rotvec_from_quat

_JERK_INTERVAL = 1 / 60  # [s] at least, over which hinges' jerk is told


def smoothness_of(
    robot: Morphology,
    q: Coordinates,
    reference: Coordinates | None,
    frame_time: float,
    dofs: list[int],
    stiffening: Float[np.ndarray, "A C"],
    penalty_scale: Float[np.ndarray, "T"],
    point: PointAcceleration | None,
) -> Smoothness:
    """The residuals that couple the frames of `q`, in some dofs.

    With a the accelerations, r = w a: motion fades above `SMOOTH_CUTOFF`. With those of a
    `reference`, a0, also r = c (a - a0): what is changed about it fades above the lower
    `AVOIDANCE_CUTOFF`. `stiffening` multiplies w, `penalty_scale` the weight of overspeed.
    """
    weights = stiffening * acceleration_weights(robot)[dofs] / frame_time**2
    differences = accelerations(robot, q)[:, dofs]
    if reference is not None:
        # w² |a|² + c² |a - a0|² is, but for a constant, one square around c² / (w² + c²) a0.
        share = 1.0 / (1.0 + stiffening**2 * (AVOIDANCE_CUTOFF / SMOOTH_CUTOFF) ** 4)
        weights = weights / np.sqrt(1.0 - share)
        differences -= share * accelerations(robot, reference)[:, dofs]
    return Smoothness(
        weights,
        differences,
        W_OVERSPEED / frame_time * penalty_scale[1:, None],
        overspeed(robot, q, frame_time)[:, dofs],
        point,
    )


def com_acceleration(
    robot: Morphology,
    q: Coordinates,
    planned: Float[np.ndarray, "T 3"] | None,
    frame_time: float,
    block: Block,
    *,
    with_jacobian: bool,
) -> PointAcceleration | None:
    """r = w (c'' - c_plan''), of the centre of mass; None without a plan."""
    if planned is None or len(q) < 3:
        return None
    poses = forward_kinematics(robot.tree, q)
    away = center_of_mass(robot, poses).T - planned
    weight = per_metre(robot) * W_COM_ACCELERATION / frame_time**2
    J = np.zeros((0, len(block.dofs), 3))
    if with_jacobian:
        J = weight * com_jacobian(robot, poses, block.joints, base=block.base).transpose(2, 0, 1)
    residual = weight * second_differences(away)
    return PointAcceleration(J, residual, np.ones(len(residual), dtype=bool))


def jerk_stiffening(
    robot: Morphology, q: Coordinates, frame_time: float, source_jerks: Float[np.ndarray, "T 4"]
) -> Float[np.ndarray, "A D"]:
    """By what the acceleration weights of hinges are multiplied where these are too jerky: the RMS
    jerk around, over `MAX_JERK` or, of a limb, over a share of the source's (`limb_jerks`
    [rad/s³]) where that is more; at least 1. Jerk is told over `_JERK_INTERVAL`, or more frames a
    second would make a motion jerkier."""
    tree = robot.tree
    out = np.ones((max(len(q) - 2, 0), tree.nv))
    hinges = ~tree.balls
    step = max(1, round(_JERK_INTERVAL / frame_time))
    if len(q) > 3 * step:
        angles = q.angles[:, hinges]
        for _ in range(3):
            angles = angles[step:] - angles[:-step]
        window = max(1, 2 * round(JERK_WINDOW / frame_time) + 1)
        mean = uniform_filter1d(angles**2, window, axis=0, mode="nearest")
        rms = np.sqrt(np.maximum(mean, 0.0)) / (step * frame_time) ** 3
        before = (3 * step - 1) // 2
        rms = np.pad(rms, ((before, 3 * step - 2 - before), (0, 0)), "edge")
        most = np.full((len(q) - 2, tree.nv), MAX_JERK)
        for dofs, jerk_of_source in zip(limb_dofs(robot), source_jerks[1:-1].T, strict=True):
            most[:, dofs] = np.maximum(MAX_JERK, JERK_SHARE * jerk_of_source)[:, None]
        out[:, tree.dof_starts[hinges]] = np.maximum(rms / most[:, tree.dof_starts[hinges]], 1.0)
    return out


def limit_speed(robot: Morphology, q: Coordinates, frame_time: float) -> Coordinates:
    """Hinge angles that turn at most `MAX_HINGE_SPEED`: the mean of the largest such curve below
    them and the smallest above. Jumps from limit to limit become ramps, which Gauss-Newton can
    bend."""
    time = MAX_HINGE_SPEED * frame_time * np.arange(len(q))[:, None]

    def below(angles: Float[np.ndarray, "T N"]) -> Float[np.ndarray, "T N"]:
        ahead = np.minimum.accumulate(angles - time) + time
        return np.minimum.accumulate((ahead + time)[::-1])[::-1] - time

    angles = np.where(robot.tree.balls, q.angles, (below(q.angles) - below(-q.angles)) / 2)
    return Coordinates(q.pos, q.quat, angles, q.ball_quats)


def acceleration_weights(robot: Morphology) -> Float[np.ndarray, "D"]:
    """The weight w of each dof's acceleration [s²/rad]: 1 / (2 pi `SMOOTH_CUTOFF`)², at which a
    sine of that frequency costs as much as its own absence from a residual of weight 1. The base is
    weighed as what it follows, its position [s²/m] as the hips' and its rotation as the pelvis's;
    legs less."""
    weights = np.full(robot.tree.nv, 1.0 / (2 * np.pi * SMOOTH_CUTOFF) ** 2)
    weights[:3] *= per_metre(robot) * W_HIPS_POSITION
    weights[3:6] *= W_ROTATION["pelvis"]
    left_leg, right_leg, *_ = limb_dofs(robot)
    weights[[*left_leg, *right_leg]] *= LEG_SHARE
    return weights


def accelerations(robot: Morphology, q: Coordinates) -> Float[np.ndarray, "A D"]:
    """Second differences of all dofs [m, rad]; for rotations, those of the rotation vectors from
    frame to frame."""
    tree = robot.tree
    out = np.zeros((max(len(q) - 2, 0), tree.nv))
    out[:, :3] = second_differences(q.pos)
    out[:, 3:6] = _angular_accelerations(q.quat)
    hinges = ~tree.balls
    out[:, tree.dof_starts[hinges]] = second_differences(q.angles[:, hinges])
    for j in np.flatnonzero(tree.balls):
        assert q.ball_quats is not None
        at = tree.dof_starts[j]
        out[:, at : at + 3] = _angular_accelerations(q.ball_quats[:, j])
    return out


def overspeed(robot: Morphology, q: Coordinates, frame_time: float) -> Float[np.ndarray, "V D"]:
    """By how much [rad] hinges turn farther from frame to frame than `MAX_HINGE_SPEED` lets."""
    tree = robot.tree
    out = np.zeros((max(len(q) - 1, 0), tree.nv))
    hinges = ~tree.balls
    steps = np.diff(q.angles[:, hinges], axis=0)
    max_step = MAX_HINGE_SPEED * frame_time
    out[:, tree.dof_starts[hinges]] = steps - np.clip(steps, -max_step, max_step)
    return out


def _angular_accelerations(q: Float[np.ndarray, "T 4"]) -> Float[np.ndarray, "A 3"]:
    if len(q) < 3:
        return np.zeros((0, 3))
    return np.diff(rotvec_from_quat(quat_mul(q[1:], quat_conj(q[:-1]))), axis=0)
