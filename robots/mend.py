"""What is still wrong after a trajectory is solved, made good where it is.

Parts that are in each other, soles below the floor and hinges that rush are soft walls to the
solver: other wishes may outweigh them. The frames around these are solved again, with walls that
grow firmer round by round (a penalty method: Nocedal and Wright, "Numerical Optimization", 17.1).
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Int
from scipy.ndimage import binary_dilation

from robots.descent import Mending, solve_stage, stride_of
from robots.footing import Footing, corners_of
from robots.morphology import Morphology
from robots.stage import Stage
from robots.targets import Targets
from robots.ties import jolted, rush
from robots.tree import Coordinates, forward

_ROUNDS, _FIRMER = 5, 3.0
_STEPS, _LITTLE = 12, 0.01  # of each round
_AROUND = 0.4  # [s] before and after a frame in which it may be made good
_JOLTED = 5.0  # times as much as makes hinges stiffer
_DEEP, _SUNK, _HASTE = 0.010, 0.006, 0.5  # [m] of what parts keep between them; [m]; [rad/s]


def mend(
    robot: Morphology,
    targets: Targets,
    footing: Sequence[Footing],
    q: Coordinates,
    stage: Stage,
) -> Coordinates:
    """`q` with a stage's columns changed around the frames that something is wrong in; the best of
    the rounds."""
    firm = np.ones(len(q))
    around = max(2, round(_AROUND / targets.frame_time))
    wide = np.ones(2 * around + 1, dtype=bool)
    best, least = q, np.inf
    for k in range(_ROUNDS + 1):
        wrong = wrong_in(robot, targets, q, stage)
        rough = wrong | jolting(robot, targets, q, stage)
        if rough.sum() < least:
            best, least = q, rough.sum()
        if k == _ROUNDS or not least:
            break
        for frames in stretches(binary_dilation(rough, wide)):
            # Ties reach two frames: so many at its ends stay, but for the trajectory's.
            fixed = np.zeros(len(frames), dtype=bool)
            fixed[:2] = frames[0] > 0
            fixed[-2:] |= frames[-1] < len(q) - 1
            part = solve_stage(
                robot,
                targets.at(frames),
                [foot.at(frames) for foot in footing],
                q.at(frames),
                stage,
                _STEPS,
                _LITTLE,
                0.0,
                apart=True,
                mending=Mending(firm[frames], fixed),
            )
            q = q.replaced(frames, part)
            if wrong[frames].any():
                firm[frames] *= _FIRMER
    return best


def stretches(mask: Bool[np.ndarray, "T"]) -> list[Int[np.ndarray, "S"]]:
    """The frames of each stretch that is true."""
    frames = np.flatnonzero(mask)
    return [part for part in np.split(frames, np.flatnonzero(np.diff(frames) > 1) + 1) if len(part)]


def jolting(
    robot: Morphology, targets: Targets, q: Coordinates, stage: Stage
) -> Bool[np.ndarray, "T"]:
    """The frames in which hinges of a stage jolt, in spite of what smooths them."""
    out = np.zeros(len(q), dtype=bool)
    jolts = jolted(robot, q, targets.frame_time)[:, stage.columns]
    out[1:-1] = jolts.max(1, initial=1.0) > _JOLTED
    return out


def wrong_in(
    robot: Morphology, targets: Targets, q: Coordinates, stage: Stage
) -> Bool[np.ndarray, "T"]:
    """The frames in which parts that a stage moves are where, or as fast as, they must not be."""
    frames = forward(robot.tree, q)
    nears = robot.collisions.near(frames, stage, stride_of(targets))
    wrong = robot.collisions.depth(frames, nears) > _DEEP
    fast = np.abs(rush(robot, q, targets.frame_time)[:, stage.columns]).max(1, initial=0.0)
    wrong[1:] |= fast > _HASTE * targets.frame_time
    if stage.base:
        for sole in robot.soles:
            wrong |= corners_of(frames, sole)[:, 2].min(0) < -_SUNK
    return wrong
