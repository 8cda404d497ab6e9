"""Repair: the frames that violate a limit after a trajectory is solved are solved again.

Collisions, the floor and the speed of hinges are soft penalties to the solver: other residuals may
outweigh them. The frames around a violation are solved again with penalties that grow round by
round (a penalty method: Nocedal and Wright, "Numerical Optimization", 17.1). Arms that are stuck in
something are first led out of it.
"""

import numpy as np
from jaxtyping import Bool
from scipy.ndimage import binary_dilation, maximum_filter1d

from robots.model.morphology import Morphology
from robots.solver.block import Block
from robots.solver.collision import collisions_of
from robots.solver.descent import (
    Repair,
    collision_stride,
    smooth_lower_envelope,
    solve_block,
)
from robots.solver.exact_contact import exact_contacts_of
from robots.solver.floor import depth_in_floor
from robots.solver.footprints import points_of
from robots.solver.hinges import LIMIT_CLEARANCE
from robots.solver.holds import Holds
from robots.solver.objective import linearize
from robots.solver.smoothness import jerk_stiffening, overspeed
from robots.solver.targets import Targets
from robots.tree import Coordinates, forward_kinematics
from spark.runs import true_runs

_MAX_ROUNDS = 6
PENALTY_GROWTH = 3.0  # from round to round, of the penalties' weights
_LEAD_OUT_ROUND = 3  # the round before which arms are led out of what they are stuck in
_MAX_ITER, _REL_TOL = 12, 0.01  # of each round
_AROUND = 0.4  # [s] before and after a violation that are solved again
_MAX_JERK_RATIO = 5.0  # jerk, over the one from which hinges are smoothed, that is a violation
_SEARCH_DISTANCE = 0.01  # [m] between approximate shapes within which the exact ones are measured
_MAX_DEPTH = 0.009  # hip heights of parts in each other, beyond their clearance,
MAX_SINKING = 0.009  # and of a sole's corner, or another part, below the floor
_W_VIOLATION = 20.0  # what a frame with a violation costs: as four limbs that are 90 degrees off
_MAX_OVERSPEED = 0.5  # [rad/s] of a hinge beyond the speed at which it is held back


def repair(
    robot: Morphology,
    targets: Targets,
    holds: Holds,
    q: Coordinates,
    block: Block,
) -> Coordinates:
    """`q` with the block's dofs solved again around the frames with violations."""
    around = max(2, round(_AROUND / targets.frame_time))
    neighbours = np.ones(2 * around + 1, dtype=bool)
    violated = violations(robot, targets, q, block, collision_stride(targets))
    violated |= too_jerky(robot, targets, q, block)
    for start, stop in true_runs(binary_dilation(violated, neighbours)):
        frames = np.arange(start, stop)
        # Accelerations couple a frame to two: as many stay at its ends, but for the trajectory's.
        fixed = np.zeros(len(frames), dtype=bool)
        fixed[:2] = frames[0] > 0
        fixed[-2:] |= frames[-1] < len(q) - 1
        held, part = holds.at(frames), q.at(frames)
        part = _repair_stretch(robot, targets.at(frames), held, part, block, fixed)
        q = q.replaced(frames, part)
    return q


def _repair_stretch(
    robot: Morphology,
    targets: Targets,
    holds: Holds,
    q: Coordinates,
    block: Block,
    fixed: Bool[np.ndarray, "T"],
) -> Coordinates:
    """The trajectory of the round with the fewest violations, but for poses that are far worse."""
    penalty_scale = np.ones(len(q))
    best, least = q, np.inf
    for k in range(_MAX_ROUNDS + 1):
        violated = violations(robot, targets, q, block, 1)
        rough = violated | too_jerky(robot, targets, q, block)
        pose = linearize(robot, targets, holds, q, block, [], with_jacobian=False)
        worth = _W_VIOLATION * rough.sum() + pose.cost.sum()
        if worth < least:
            best, least = q, worth
        if k == _MAX_ROUNDS or not rough.any():
            break
        if k == _LEAD_OUT_ROUND and not block.base and violated.any():
            q = _lead_out(robot, q, block, violated, fixed)
        q = solve_block(
            robot,
            targets,
            holds,
            q,
            block,
            max_iter=_MAX_ITER,
            rel_tol=_REL_TOL,
            max_rejected=0.0,
            avoid_collisions=True,
            repair=Repair(penalty_scale, fixed),
        )
        if violated.any():
            penalty_scale = penalty_scale * PENALTY_GROWTH
    return best


def _lead_out(
    robot: Morphology,
    q: Coordinates,
    block: Block,
    violated: Bool[np.ndarray, "T"],
    fixed: Bool[np.ndarray, "T"],
) -> Coordinates:
    """`q` with the block's hinges as in the T-pose where there are violations, and on the way there
    and back between: out in the open, from where descent finds another way."""
    at = np.flatnonzero(violated).tolist()
    count = max(1, at[0], len(q) - 1 - at[-1])
    window = 2 * max(1, count // 2) + 1
    untouched = 1.0 - maximum_filter1d(violated.astype(np.float64), 3)
    share = 1.0 - smooth_lower_envelope(untouched, window)
    share[fixed] = 0.0
    joints = [j for j in block.joints if not robot.tree.balls[j]]
    angles = q.angles.copy()
    rest = robot.tpose.angles[0, joints]
    angles[:, joints] += share[:, None] * (rest - angles[:, joints])
    return Coordinates(q.pos, q.quat, angles, q.ball_quats).clipped(robot.tree, LIMIT_CLEARANCE)


def too_jerky(
    robot: Morphology, targets: Targets, q: Coordinates, block: Block
) -> Bool[np.ndarray, "T"]:
    """The frames in which the block's hinges are too jerky, in spite of what smooths them."""
    out = np.zeros(len(q), dtype=bool)
    ratio = jerk_stiffening(robot, q, targets.frame_time)[:, block.dofs]
    out[1:-1] = ratio.max(1, initial=1.0) > _MAX_JERK_RATIO
    return out


def violations(
    robot: Morphology, targets: Targets, q: Coordinates, block: Block, stride: int
) -> Bool[np.ndarray, "T"]:
    """The frames in which parts that the block moves collide, sink or are too fast; collisions are
    searched for in every `stride`-th frame and, where candidates are, in all."""
    poses = forward_kinematics(robot.tree, q)
    candidates = collisions_of(robot).candidates(poses, block, stride, _SEARCH_DISTANCE)
    max_depth, max_sinking = (x * robot.rig.hip_height for x in (_MAX_DEPTH, MAX_SINKING))
    violated = exact_contacts_of(robot).depth(robot.to_qpos(q), candidates) > max_depth
    fast = np.abs(overspeed(robot, q, targets.frame_time)[:, block.dofs]).max(1, initial=0.0)
    violated[1:] |= fast > _MAX_OVERSPEED * targets.frame_time
    if block.base:
        for sole in robot.soles:
            violated |= points_of(robot, poses, sole)[:, 2].min(0) < -max_sinking
    return violated | (depth_in_floor(robot, poses, block) > max_sinking)
