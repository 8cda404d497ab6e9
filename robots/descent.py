"""Gauss-Newton in some columns of a robot's trajectory, over all of its frames at once."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import minimum_filter1d, uniform_filter1d

from robots.collision import Near
from robots.footing import Footing
from robots.morphology import Morphology
from robots.normal import Normal, Ties
from robots.objective import linearize
from robots.stage import Stage
from robots.targets import Targets
from robots.ties import jolted, ties_of
from robots.tree import Coordinates, forward

_AROUND = 0.15  # [s] before and after a frame in which a step must not do harm
_HALVINGS = 5  # of a step, when mending
_PATIENCE = 3  # steps without progress, while many frames refuse them
_LONGEST = 1.0  # [rad, m] a column moves in a step
_LOOK = 0.06  # [s] from one look for collisions to the next
_DAMPING, _IMMOVABLE = 1e-3, 1e8
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

    A step is judged where it is taken: frames whose surroundings get worse keep their place, and
    are damped more from then on (Levenberg and Marquardt's rule, a frame).
    """
    tree = robot.tree
    window = max(1, 2 * round(_AROUND / targets.frame_time) + 1)
    firm, least = np.ones(len(q)), np.full(len(q), _DAMPING)
    if mending:
        firm, least = mending.firm, np.where(mending.fixed, _IMMOVABLE, _DAMPING)
    damping = least
    start = q if apart else None
    nears: list[Near] = []
    stiffer = np.ones((max(len(q) - 2, 0), len(stage.columns)))

    def look(q: Coordinates, rows: bool) -> tuple[Normal, Ties, Float[np.ndarray, "T"]]:
        exact = mending is not None
        normal = linearize(robot, targets, footing, q, stage, nears, firm, rows=rows, exact=exact)
        ties = ties_of(robot, q, start, targets.frame_time, stage.columns, stiffer, firm)
        return normal, ties, uniform_filter1d(normal.cost + ties.cost(len(q)), window)

    last, idle = np.inf, 0
    for k in range(most):
        if apart and k % 3 == 0:
            stride = 1 if mending else stride_of(targets)
            nears = robot.collisions.near(forward(tree, q), stage, stride)
        stiffer = np.maximum(stiffer, jolted(robot, q, targets.frame_time)[:, stage.columns])
        normal, ties, cost = look(q, rows=True)
        limits = q.at_limits(tree, SHORT_OF_LIMIT)[:, stage.columns]
        step = np.zeros((len(q), tree.size))
        step[:, stage.columns] = normal.solve_together(ties, damping, limits)
        long = np.minimum(1.0, _LONGEST / np.maximum(np.abs(step).max(1), 1e-9))
        step *= eased(long, window)[:, None]
        trial = q.moved(tree, step).clipped(tree, SHORT_OF_LIMIT)
        after = look(trial, rows=False)[2]
        if mending:
            for _ in range(_HALVINGS):
                if after.sum() <= cost.sum():
                    break
                step *= 0.5
                trial = q.moved(tree, step).clipped(tree, SHORT_OF_LIMIT)
                after = look(trial, rows=False)[2]
            worse = np.full(len(q), after.sum() > cost.sum())
        else:
            worse = after > cost * (1 + 1e-3) + 1e-9
        damping = np.where(worse, damping * 10, np.maximum(damping / 5, least))
        if worse.any():
            step *= eased(1.0 - worse, window)[:, None]
            trial = q.moved(tree, step).clipped(tree, SHORT_OF_LIMIT)
        q = trial
        idle = idle + 1 if cost.sum() > (1 - little) * last else 0
        if idle > (_PATIENCE if worse.mean() > refused else 0):
            break
        last = float(cost.sum())
    return q


def eased(scale: Float[np.ndarray, "T"], window: int) -> Float[np.ndarray, "T"]:
    """A smooth curve that nowhere exceeds `scale`: without kinks, which steps would take over."""
    least = minimum_filter1d(scale, window, mode="nearest")
    box = max(1, 2 * (window // 6) + 1)
    for _ in range(3):
        least = uniform_filter1d(least, box, mode="nearest")
    return least
