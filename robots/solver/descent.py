"""Gauss-Newton in a block of a robot's coordinates, over all frames of the trajectory at once."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import minimum_filter1d, uniform_filter1d

from robots.coupling import Smoothness
from robots.kinematics import forward_kinematics
from robots.least_squares import NormalEquations
from robots.model.morphology import Morphology
from robots.solver.block import Block
from robots.solver.candidates import Candidate
from robots.solver.collision import collisions_of
from robots.solver.hinges import LIMIT_CLEARANCE
from robots.solver.holds import Holds
from robots.solver.objective import linearize
from robots.solver.smoothness import com_acceleration, jerk_stiffening, smoothness_of
from robots.solver.targets import Targets
from robots.tree import Coordinates

WINDOW = 0.15  # [s] before and after a frame over which its cost is averaged to judge a step
_WIDE_WINDOW = 0.5  # [s] the same for what is gained nearby,
_MAX_HALVINGS = 4  # of a step, where it is rejected
_ALLOWED_LOSS = 0.5  # and the share of that by which a frame's cost may rise
COLLISION_PERIOD = 5  # steps from one search for collision candidates to the next
_COLLISION_INTERVAL = 0.06  # [s] between the frames that are searched
MAX_STEP = 1.0  # [rad, m] of a dof in one step
MIN_DAMPING = 1e-3  # [1] on the diagonal of the normal equations
REJECTED_DAMPING = 0.1  # at least, where a step was rejected


class Steps(NamedTuple):
    """Of Gauss-Newton: at most `most` steps, of which one is the last that lowers the cost by less
    than the share `gain` of it. A step of the base that more than the share `rejected` of the
    frames reject is shortened there. In more than one of the `solves` of a step, hinges that come
    to their limits stop there, and the others know it."""

    most: int
    gain: float
    rejected: float
    solves: int = 1


def collision_stride(frame_time: float) -> int:
    """The number of frames from one that is searched for collisions to the next."""
    return max(1, round(_COLLISION_INTERVAL / frame_time))


def collision_candidates(
    robot: Morphology, targets: Targets, q: Coordinates, block: Block
) -> list[Candidate]:
    """The parts that are near each other at `q`, or between the frames that are searched."""
    poses = forward_kinematics(robot.tree, q)
    return collisions_of(robot).candidates(poses, block, collision_stride(targets.frame_time))


def solve_block(
    robot: Morphology,
    targets: Targets,
    holds: Holds,
    q: Coordinates,
    block: Block,
    steps: Steps,
    candidates: Sequence[Candidate] | None = None,
) -> Coordinates:
    """Gauss-Newton steps in the block's dofs, from `q`.

    With `candidates`, the parts that are near each other at `q`, parts in each other are pushed
    apart, by a change of `q` that is smoother than `q`.

    A step is judged frame by frame: where the cost around a frame rises by more than a share
    of what is gained nearby, the step is rejected there. One of the base that many frames reject is
    halved there, again and again: down to the floor, of which nothing is felt from above, most are
    too long. Where it is rejected all the same, damping grows
    (Levenberg and Marquardt's rule, a frame each). Between rejected and accepted frames the step is
    blended, and the normal equations with it: exact where the cost is a parabola.
    """
    tree = robot.tree
    window = max(1, 2 * round(WINDOW / targets.frame_time) + 1)
    wide = max(1, 2 * round(_WIDE_WINDOW / targets.frame_time) + 1)
    damping = np.full(len(q), MIN_DAMPING)
    start = None if candidates is None else q

    stiffening = np.ones((max(len(q) - 2, 0), len(block.dofs)))

    def linearize_at(q: Coordinates, with_jacobian: bool = True) -> NormalEquations:
        terms = robot, targets, holds, q, block, candidates or []
        return linearize(*terms, with_jacobian=with_jacobian)

    def smoothness_at(q: Coordinates, with_jacobian: bool) -> Smoothness:
        frame_time = targets.frame_time
        terms = robot, q, targets.com, frame_time, block
        point = com_acceleration(*terms, with_jacobian=with_jacobian)
        return smoothness_of(
            robot, q, start, frame_time, block.dofs, stiffening, np.ones(len(q)), point
        )

    def taken(step: Float[np.ndarray, "T V"]) -> Coordinates:
        return q.integrated(tree, step).clipped(tree, LIMIT_CLEARANCE)

    def judged(
        trial: Coordinates, normal: NormalEquations
    ) -> tuple[Float[np.ndarray, "T"], Bool[np.ndarray, "T"]]:
        """The cost around each frame after a step, and where that rejects it."""
        trial_cost = normal.cost + smoothness_at(trial, False).cost(len(q))
        after = uniform_filter1d(trial_cost, window)
        gained = np.maximum(uniform_filter1d(cost - after, wide), 0.0)
        return after, after > cost * (1 + 1e-3) + _ALLOWED_LOSS * gained + 1e-9

    normal = linearize_at(q)
    for k in range(steps.most):
        jerky = jerk_stiffening(robot, q, targets.frame_time, targets.jerks)[:, block.dofs]
        stiffening = np.maximum(stiffening, jerky)
        coupling = smoothness_at(q, True)
        cost = uniform_filter1d(normal.cost + coupling.cost(len(q)), window)
        room = q.room(tree, LIMIT_CLEARANCE)[..., block.dofs]
        step = np.zeros((len(q), tree.nv))
        step[:, block.dofs] = normal.solve_coupled(coupling, damping, room, solves=steps.solves)
        share = np.minimum(1.0, MAX_STEP / np.maximum(np.abs(step).max(1), 1e-9))
        step *= smooth_lower_envelope(share, window)[:, None]
        trial, is_last = taken(step), k == steps.most - 1
        if candidates is not None and k % COLLISION_PERIOD == COLLISION_PERIOD - 1:
            candidates = collision_candidates(robot, targets, trial, block)
        trial_normal = linearize_at(trial, with_jacobian=not is_last)
        after, rejected = judged(trial, trial_normal)
        for _ in range(_MAX_HALVINGS):
            if not block.base or rejected.mean() <= steps.rejected:
                break
            step *= smooth_lower_envelope(1.0 - 0.5 * rejected, window)[:, None]
            trial = taken(step)
            trial_normal = linearize_at(trial, with_jacobian=False)
            after, rejected = judged(trial, trial_normal)
        if not (is_last or trial_normal.with_jacobian):
            trial_normal = linearize_at(trial)
        damping = np.where(rejected, np.maximum(damping * 10, REJECTED_DAMPING), damping / 10)
        damping = np.maximum(damping, MIN_DAMPING)
        if rejected.any():
            share = smooth_lower_envelope(1.0 - rejected, window)
            trial = taken(step * share[:, None])
            if trial_normal.with_jacobian:
                trial_normal = normal.blended(trial_normal, share)
            after = cost + share * (after - cost)
        gained_little = after.sum() > (1 - steps.gain) * cost.sum()
        q, normal = trial, trial_normal
        if gained_little:
            break
    return q


def smooth_lower_envelope(scale: Float[np.ndarray, "T"], window: int) -> Float[np.ndarray, "T"]:
    """A smooth curve that nowhere exceeds `scale`: a kink in a step's size would be one in the
    trajectory."""
    envelope = minimum_filter1d(scale, window, mode="nearest")
    box = max(1, 2 * (window // 6) + 1)
    for _ in range(3):
        envelope = uniform_filter1d(envelope, box, mode="nearest")
    return envelope
