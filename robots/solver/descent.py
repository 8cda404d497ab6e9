"""Gauss-Newton in some columns of a robot's trajectory, over all of its frames at once."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import minimum_filter1d, uniform_filter1d

from robots.least_squares import NormalEquations, Smoothness
from robots.model.morphology import Morphology
from robots.solver.block import Stage
from robots.solver.collision import collisions_of
from robots.solver.footprints import Footing
from robots.solver.objective import linearize
from robots.solver.smoothness import jolted, ties_of
from robots.solver.targets import Targets
from robots.tree import Coordinates, forward_kinematics

_AROUND = 0.15  # [s] before and after a frame in which a step must not do harm
_WIDE, _GIVEN = 0.5, 0.5  # [s] around it, and of what is gained there a frame may lose so much
_HALVINGS = 6  # of a step, when mending
_PATIENCE = 2  # steps without progress, while many frames refuse them
_WATCH = 5  # steps from one look for collisions to the next
_LONGEST = 1.0  # [rad, m] a column moves in a step
_LOOK = 0.06  # [s] between the frames that are looked at for collisions
_DAMPING, _CAREFUL, _IMMOVABLE = 1e-3, 0.1, 1e8
SHORT_OF_LIMIT = np.radians(0.75)


@dataclass(frozen=True, eq=False)
class Mending:
    """Frames that are solved again: `firm` is how much firmer than elsewhere their parts are kept
    apart, their feet above the floor and their hinges slow; `fixed` ones stay."""

    firm: Float[np.ndarray, "T"]
    fixed: Bool[np.ndarray, "T"]


def stride_of(targets: Targets) -> int:
    """The frames from one look for collisions to the next."""
    return max(1, round(_LOOK / targets.frame_time))


def solve_stage(
    robot: Morphology,
    targets: Targets,
    footing: list[Footing],
    q: Coordinates,
    stage: Stage,
    most: int,
    little: float,
    refused: float,
    *,
    apart: bool,
    mending: Mending | None = None,
) -> Coordinates:
    """Gauss-Newton in the stage's columns, from `q`, damped where it would do harm.

    With `apart`, parts that run into each other give way, without haste: what changes `q` is
    smoother than `q`. When `mending`, steps are judged as a whole and halved until they do no harm.

    A step is judged where it is taken: frames that get worse, with what is around them, by more
    than a share of what is gained nearby, keep their place and are damped more from then on
    (Levenberg and Marquardt's rule, a frame). Where some stay and others go, the normal equations
    are mixed alike: that is exact on a parabola.
    """
    tree = robot.tree
    window = max(1, 2 * round(_AROUND / targets.frame_time) + 1)
    wide = max(1, 2 * round(_WIDE / targets.frame_time) + 1)
    firm, least = np.ones(len(q)), np.full(len(q), _DAMPING)
    if mending:
        firm, least = mending.firm, np.where(mending.fixed, _IMMOVABLE, _DAMPING)
    damping = least
    start = q if apart else None
    stride = 1 if mending else stride_of(targets)
    nears = collisions_of(robot).near(forward_kinematics(tree, q), stage, stride) if apart else []
    stiffer = np.ones((max(len(q) - 2, 0), len(stage.columns)))

    def look(q: Coordinates, rows: bool = True) -> NormalEquations:
        exact = mending is not None
        return linearize(robot, targets, footing, q, stage, nears, firm, rows=rows, exact=exact)

    def tie(q: Coordinates) -> Smoothness:
        return ties_of(robot, q, start, targets.frame_time, stage.columns, stiffer, firm)

    normal, idle = look(q), 0
    for k in range(most):
        stiffer = np.maximum(stiffer, jolted(robot, q, targets.frame_time)[:, stage.columns])
        ties = tie(q)
        cost = uniform_filter1d(normal.cost + ties.cost(len(q)), window)
        limits = q.at_limits(tree, SHORT_OF_LIMIT)[:, stage.columns]
        step = np.zeros((len(q), tree.nv))
        step[:, stage.columns] = normal.solve_coupled(ties, damping, limits)
        long = np.minimum(1.0, _LONGEST / np.maximum(np.abs(step).max(1), 1e-9))
        step *= eased(long, window)[:, None]
        share = np.ones(len(q))
        for _ in range(_HALVINGS if mending else 1):
            trial = q.integrated(tree, step).clipped(tree, SHORT_OF_LIMIT)
            if apart and k % _WATCH == _WATCH - 1:
                nears = collisions_of(robot).near(forward_kinematics(tree, trial), stage, stride)
            there = look(trial, rows=k < most - 1)
            after = uniform_filter1d(there.cost + tie(trial).cost(len(q)), window)
            if not mending or after.sum() <= cost.sum():
                break
            step *= 0.5
        if mending:
            worse = np.full(len(q), after.sum() > cost.sum())
        else:
            gained = np.maximum(uniform_filter1d(cost - after, wide), 0.0)
            worse = after > cost * (1 + 1e-3) + _GIVEN * gained + 1e-9
        damping = np.where(worse, np.maximum(damping * 10, _CAREFUL), damping / 10)
        damping = np.maximum(damping, least)
        if worse.any():
            share = eased(1.0 - worse, window)
            trial = q.integrated(tree, step * share[:, None]).clipped(tree, SHORT_OF_LIMIT)
            there = normal.blended(there, share) if there.with_jacobian else there
        q, normal = trial, there
        left = (cost + share * (after - cost)).sum()
        idle = idle + 1 if left > (1 - little) * cost.sum() else 0
        if idle > (_PATIENCE if worse.mean() > refused else 0):
            break
    return q


def eased(scale: Float[np.ndarray, "T"], window: int) -> Float[np.ndarray, "T"]:
    """A smooth curve that nowhere exceeds `scale`: without kinks, which steps would take over."""
    least = minimum_filter1d(scale, window, mode="nearest")
    box = max(1, 2 * (window // 6) + 1)
    for _ in range(3):
        least = uniform_filter1d(least, box, mode="nearest")
    return least
