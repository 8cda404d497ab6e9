"""What is still wrong after a trajectory is solved, made good where it is.

Parts that are in each other, soles below the floor and hinges that rush are soft walls to the
solver: other wishes may outweigh them. The frames around these are solved again, with walls that
grow firmer round by round (a penalty method: Nocedal and Wright, "Numerical Optimization", 17.1).
Arms that would have to pass through something are led around it.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool
from scipy.ndimage import binary_dilation, maximum_filter1d

from robots.model.morphology import Morphology
from robots.solver.block import Stage
from robots.solver.collision import collisions_of
from robots.solver.descent import SHORT_OF_LIMIT, Mending, eased, solve_stage, stride_of
from robots.solver.exact_contact import exact_contacts_of
from robots.solver.footprints import Footing, corners_of
from robots.solver.smoothness import jolted, rush
from robots.solver.targets import Targets
from robots.tree import Coordinates, forward_kinematics
from spark.runs import true_runs

_ROUNDS, _FIRMER = 6, 3.0
_LED = 3  # rounds after which arms are led out of what they are stuck in
_STEPS, _LITTLE = 12, 0.01  # of each round
_AROUND = 0.4  # [s] before and after a frame in which it may be made good
_JOLTED = 5.0  # times as much as makes hinges stiffer
_CLOSE = 0.01  # [m] by the quick measure, where the exact one is asked
_DEEP, _SUNK, _HASTE = 0.006, 0.006, 0.5  # [m] of what parts keep between them; [m]; [rad/s]


def mend(
    robot: Morphology,
    targets: Targets,
    footing: Sequence[Footing],
    q: Coordinates,
    stage: Stage,
) -> Coordinates:
    """`q` with a stage's columns changed around the frames that something is wrong in."""
    around = max(2, round(_AROUND / targets.frame_time))
    wide = np.ones(2 * around + 1, dtype=bool)
    wrong = wrong_in(robot, targets, q, stage, stride_of(targets))
    for start, stop in true_runs(binary_dilation(wrong | jolting(robot, targets, q, stage), wide)):
        frames = np.arange(start, stop)
        # Ties reach two frames: so many at its ends stay, but for the trajectory's.
        fixed = np.zeros(len(frames), dtype=bool)
        fixed[:2] = frames[0] > 0
        fixed[-2:] |= frames[-1] < len(q) - 1
        there = [foot.at(frames) for foot in footing]
        part = _mended(robot, targets.at(frames), there, q.at(frames), stage, fixed)
        q = q.replaced(frames, part)
    return q


def _mended(
    robot: Morphology,
    targets: Targets,
    footing: list[Footing],
    q: Coordinates,
    stage: Stage,
    fixed: Bool[np.ndarray, "T"],
) -> Coordinates:
    """The best of the rounds."""
    firm = np.ones(len(q))
    best, least = q, np.inf
    for k in range(_ROUNDS + 1):
        wrong = wrong_in(robot, targets, q, stage, 1)
        rough = wrong | jolting(robot, targets, q, stage)
        if rough.sum() < least:
            best, least = q, rough.sum()
        if k == _ROUNDS or not least:
            break
        if k == _LED and not stage.base and wrong.any():
            q = _led_out(robot, q, stage, wrong, fixed)
        mending = Mending(firm, fixed)
        ends = (_STEPS, _LITTLE, 0.0)
        q = solve_stage(robot, targets, footing, q, stage, *ends, apart=True, mending=mending)
        if wrong.any():
            firm = firm * _FIRMER
    return best


def _led_out(
    robot: Morphology,
    q: Coordinates,
    stage: Stage,
    wrong: Bool[np.ndarray, "T"],
    fixed: Bool[np.ndarray, "T"],
) -> Coordinates:
    """`q` with a stage's hinges as in the T-pose where something is wrong, and on the way there and
    back between: out in the open, from where another way is found."""
    at = np.flatnonzero(wrong).tolist()
    count = max(1, at[0], len(q) - 1 - at[-1])
    window = 2 * max(1, count // 2) + 1
    share = 1.0 - eased(1.0 - maximum_filter1d(wrong.astype(np.float64), 3), window)
    share[fixed] = 0.0
    joints = [j for j in stage.joints if not robot.tree.balls[j]]
    angles = q.angles.copy()
    rest = robot.tpose.angles[0, joints]
    angles[:, joints] += share[:, None] * (rest - angles[:, joints])
    return Coordinates(q.pos, q.quat, angles, q.ball_quats).clipped(robot.tree, SHORT_OF_LIMIT)


def jolting(
    robot: Morphology, targets: Targets, q: Coordinates, stage: Stage
) -> Bool[np.ndarray, "T"]:
    """The frames in which hinges of a stage jolt, in spite of what smooths them."""
    out = np.zeros(len(q), dtype=bool)
    jolts = jolted(robot, q, targets.frame_time)[:, stage.columns]
    out[1:-1] = jolts.max(1, initial=1.0) > _JOLTED
    return out


def wrong_in(
    robot: Morphology, targets: Targets, q: Coordinates, stage: Stage, stride: int
) -> Bool[np.ndarray, "T"]:
    """The frames in which parts that a stage moves are where, or as fast as, they must not be;
    collisions are looked for in every `stride`-th and, near these, in all."""
    frames = forward_kinematics(robot.tree, q)
    nears = collisions_of(robot).near(frames, stage, stride, _CLOSE)
    wrong = exact_contacts_of(robot).depth(robot.to_qpos(q), nears) > _DEEP
    fast = np.abs(rush(robot, q, targets.frame_time)[:, stage.columns]).max(1, initial=0.0)
    wrong[1:] |= fast > _HASTE * targets.frame_time
    if stage.base:
        for sole in robot.soles:
            wrong |= corners_of(frames, sole)[:, 2].min(0) < -_SUNK
    return wrong
