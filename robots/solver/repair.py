"""Repair: the frames that violate a limit after a trajectory is solved are solved again.

Collisions, the floor and the speed of hinges are soft penalties to the solver: other residuals may
outweigh them. The frames around a violation are solved again with approximate shapes, which
suffices for most, and then with MuJoCo's and ever firmer penalties (a penalty method: Nocedal and
Wright, "Numerical Optimization", 17.1).
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool
from scipy.ndimage import binary_dilation

from robots.kinematics import forward_kinematics
from robots.model.morphology import Morphology
from robots.solver.block import Block
from robots.solver.collision import collisions_of
from robots.solver.descent import collision_stride
from robots.solver.exact_contact import exact_contacts_of
from robots.solver.floor import depth_in_floor
from robots.solver.footprints import points_of
from robots.solver.holds import Holds
from robots.solver.hulls import MAX_PROTRUSION
from robots.solver.objective import linearize
from robots.solver.repair_descent import Repair, solve_spells
from robots.solver.smoothness import jerk_stiffening, overspeed
from robots.solver.spells import Spells
from robots.solver.targets import Targets
from robots.solver.walls import depth_in_walls
from robots.tree import Coordinates
from spark.runs import true_runs

_MAX_ROUNDS = 3
PENALTY_GROWTH = 3.0  # from round to round, of the penalties' weights
_AROUND = 0.4  # [s] before and after a violation that are solved again
_MAX_JERK_RATIO = 5.0  # jerk, over the one from which hinges are smoothed, that is a violation
SEARCH_DISTANCE = 0.01  # [m] between approximate shapes within which the exact ones are measured
MAX_DEPTH = 0.009  # hip heights of parts in each other, beyond their clearance,
MAX_SINKING = 0.009  # and of a sole's corner, or another part, below the floor
_W_VIOLATION = 20.0  # what a frame with a violation costs: as four limbs that are 90 degrees off
_MAX_OVERSPEED = 0.5  # [rad/s] of a hinge beyond the speed at which it is held back


def repair(
    robot: Morphology,
    targets: Targets,
    holds: Holds,
    q: Coordinates,
    block: Block,
) -> tuple[Coordinates, Bool[np.ndarray, "T"]]:
    """`q` with the block's dofs solved again around the frames with violations, and where some are
    left."""
    violated = violations(robot, targets, q, block, collision_stride(targets.frame_time))
    violated |= too_jerky(robot, targets, q, block, Spells(np.array([len(q)])))
    reach = max(2, round(_AROUND / targets.frame_time))
    runs = true_runs(binary_dilation(violated, np.ones(2 * reach + 1, dtype=bool)))
    if not runs:
        return q, violated
    frames = np.concatenate([np.arange(start, stop) for start, stop in runs])
    spells = Spells(np.array([stop - start for start, stop in runs]))
    # Accelerations couple a frame to two: as many stay at the ends, but for the trajectory's.
    fixed = np.zeros(len(frames), dtype=bool)
    for own, (start, stop) in zip(spells.slices(), runs, strict=True):
        fixed[own][:2] = start > 0
        fixed[own][-2:] |= stop < len(q)
    part = targets.at(frames), holds.at(frames), q.at(frames)
    # What is rougher than the violations can't mend them.
    exact = MAX_DEPTH * robot.rig.hip_height < MAX_PROTRUSION
    broken = Repair(robot, block, spells, *part, np.ones(len(frames)), fixed, exact)
    repaired, left = _repaired(broken)
    violated[frames] = left
    return q.replaced(frames, repaired), violated


def _repaired(broken: Repair) -> tuple[Coordinates, Bool[np.ndarray, "T"]]:
    """Of each spell the trajectory of the round with the fewest violations, but for poses that are
    far worse, and its violations."""
    robot, block, best = broken.robot, broken.block, broken.start
    frames, least = np.arange(len(broken)), np.full(len(broken.spells), np.inf)
    remain = np.zeros(len(broken), dtype=bool)
    for k in range(_MAX_ROUNDS + 1):
        q, targets, spells = broken.start, broken.targets, broken.spells
        violated = violations(robot, targets, q, block, 1, spells)
        rough = violated | too_jerky(robot, targets, q, block, spells)
        pose = linearize(robot, targets, broken.holds, q, block, [], with_jacobian=False)
        worth = spells.total(_W_VIOLATION * rough + pose.cost)
        at = np.flatnonzero((worth < least)[spells.of_frames])
        best = best.replaced(frames[at], q.at(at))
        remain[frames[at]] = violated[at]
        left = spells.any(rough)
        if k == _MAX_ROUNDS or not left.any():
            break
        frames, least = frames[left[spells.of_frames]], np.minimum(worth, least)[left]
        growth = np.where(spells.any(violated), PENALTY_GROWTH, 1.0)[left]
        broken = broken.only(left)
        penalty_scale = broken.penalty_scale * growth[broken.spells.of_frames]
        q = solve_spells(broken)
        broken = replace(broken, start=q, penalty_scale=penalty_scale, exact=True)
    return best, remain


def too_jerky(
    robot: Morphology, targets: Targets, q: Coordinates, block: Block, spells: Spells
) -> Bool[np.ndarray, "T"]:
    """The frames in which the block's hinges are too jerky, in spite of what smooths them."""
    out = np.zeros(len(q), dtype=bool)
    for own in spells.slices():
        ratio = jerk_stiffening(robot, q.at(own), targets.frame_time, targets.jerks[own])
        ratio = ratio[:, block.dofs]
        out[own][1:-1] = ratio.max(1, initial=1.0) > _MAX_JERK_RATIO
    return out


def violations(
    robot: Morphology,
    targets: Targets,
    q: Coordinates,
    block: Block,
    stride: int,
    spells: Spells | None = None,
) -> Bool[np.ndarray, "T"]:
    """The frames in which parts that the block moves collide, sink or are too fast; collisions are
    searched for in every `stride`-th frame and, where candidates are, in all. Between `spells`
    nothing is too fast."""
    poses = forward_kinematics(robot.tree, q)
    collisions = collisions_of(robot)
    candidates = collisions.candidates(poses, block, stride, SEARCH_DISTANCE)
    candidates = collisions.nearer(candidates, poses, SEARCH_DISTANCE)
    max_depth, max_sinking = (x * robot.rig.hip_height for x in (MAX_DEPTH, MAX_SINKING))
    violated = exact_contacts_of(robot).depth(robot.to_qpos(q), candidates) > max_depth
    fast = np.abs(overspeed(robot, q, targets.frame_time)[:, block.dofs]).max(1, initial=0.0)
    too_fast = fast > _MAX_OVERSPEED * targets.frame_time
    if spells is not None:
        too_fast[spells.starts[1:] - 1] = False
    violated[1:] |= too_fast
    if block.base:
        for s, sole in enumerate(robot.soles):
            lowest = points_of(robot, poses, sole)[:, 2].min(0) - targets.floor[:, s]
            violated |= lowest < -max_sinking
    if targets.around is not None:
        violated |= depth_in_walls(robot, poses, block, targets.around) > max_sinking
    return violated | (depth_in_floor(robot, poses, block) > max_sinking)
