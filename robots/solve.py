"""Retargeting onto a robot: the whole trajectory at once.

Gauss-Newton over the coordinates of all frames: every frame's pose against its targets, planted
feet, the floor, limits; neighbours tied by their accelerations (`robots.objective`,
`robots.normal`). It runs in two stages, each with everything below it free: base, trunk and legs,
which the feet tie together, then arms and head, which hang on the trunk and don't move it.
"""

import numpy as np
from jaxtyping import Float
from scipy.ndimage import minimum_filter1d, uniform_filter1d

from robots.collision import Near
from robots.footing import Footing, plan_footing, within_reach
from robots.morphology import Morphology
from robots.motion import RobotMotion
from robots.normal import Normal, Ties, second_differences
from robots.objective import CALM, FAST, PATH, RUSH, SMOOTH, linearize
from robots.project import project
from robots.stage import Stage
from robots.targets import Targets, chest_of, targets_of
from robots.tree import Coordinates, forward
from spark.canonical import CanonicalMotion
from spark.rotation import quat_conj, quat_mul, rotvec_from_quat

_STEPS = (12, 10)  # Gauss-Newton steps of the stages, at most
_LITTLE = (0.02, 0.05)  # a stage ends where a step lessens the cost by less than this share
_COARSE = 1 / 20  # [s] between the frames that are solved first
_AROUND = 0.15  # [s] before and after a frame in which a step must not do harm
_LONGEST = 1.0  # [rad, m] a column moves in one of them
_LOOK = 0.06  # [s] from one look for collisions to the next
_DAMPING = 1e-3
SHORT_OF_LIMIT = np.radians(0.75)


def copy(source: CanonicalMotion, robot: Morphology) -> RobotMotion:
    """Each joint turned as its counterpart is, as far as its hinges can, and nothing more: the row
    to compare with."""
    targets = targets_of(source, robot)
    q = project(robot, targets.world, targets.hips)
    return RobotMotion(robot, q, source.frame_time, targets.notes)


def retarget(source: CanonicalMotion, robot: Morphology) -> RobotMotion:
    """The motion of `source` on a robot, its feet planted where the source's are, within limits.

    Fast recordings are solved in some of their frames first; splines between these are the start.
    """
    targets = targets_of(source, robot)
    footing = plan_footing(robot, targets)
    q = unhurried(robot, project(robot, targets.world, targets.hips), targets.frame_time)
    stride = min(max(1, round(_COARSE / targets.frame_time)), max(len(q) // 4, 1))
    if stride > 1:
        few, places = targets.every(stride), [foot.every(stride) for foot in footing]
        q = solve(robot, few, places, q.every(stride)).between(stride, len(targets))
    q = solve(robot, targets, footing, q, polish=stride > 1)
    return RobotMotion(robot, q, source.frame_time, (*robot.notes, *targets.notes))


def solve(
    robot: Morphology,
    targets: Targets,
    footing: list[Footing],
    q: Coordinates,
    *,
    polish: bool = False,
) -> Coordinates:
    """Stage by stage, from `q`: first as if parts could run through each other, then apart. To
    polish what is nearly solved, the second is enough."""
    for stage, steps, little in zip(stages_of(robot), _STEPS, _LITTLE, strict=True):
        if not stage.columns:
            continue
        if not polish:
            q = solve_stage(robot, targets, footing, q, stage, steps, little, apart=False)
        if stage.base:
            footing = within_reach(robot, footing, q)
        if polish or robot.collisions.near(forward(robot.tree, q), stage, stride_of(targets)):
            q = solve_stage(robot, targets, footing, q, stage, steps, little, apart=True)
    return q


def stride_of(targets: Targets) -> int:
    """The frames from one look for collisions to the next."""
    return max(1, round(_LOOK / targets.frame_time))


def stages_of(robot: Morphology) -> tuple[Stage, Stage]:
    """Base, trunk and legs; then the rest."""
    tree = robot.tree
    links = {int(robot.links[chest_of(robot.rig)])}
    links |= {int(link) for sole in robot.soles for link in sole.links}
    links |= {int(robot.links[j]) for j in robot.rig.contact_joints}
    first = sorted({j for link in links for j in tree.chain(link)})
    rest = tuple(j for j in range(len(tree)) if j not in first)
    return Stage(tree, tuple(first), True), Stage(tree, rest, False)


def solve_stage(
    robot: Morphology,
    targets: Targets,
    footing: list[Footing],
    q: Coordinates,
    stage: Stage,
    most: int,
    little: float,
    *,
    apart: bool,
) -> Coordinates:
    """Gauss-Newton in the stage's columns, from `q`, damped where it would do harm.

    With `apart`, parts that run into each other give way, without haste: what changes `q` is
    smoother than `q`.

    A step is judged where it is taken: frames whose surroundings get worse keep their place, and
    are damped more from then on (Levenberg and Marquardt's rule, a frame).
    """
    tree = robot.tree
    window = max(1, 2 * round(_AROUND / targets.frame_time) + 1)
    damping = np.full(len(q), _DAMPING)

    start = q if apart else None
    nears: list[Near] = []

    def look(q: Coordinates, rows: bool) -> tuple[Normal, Ties, Float[np.ndarray, "T"]]:
        normal = linearize(robot, targets, footing, q, stage, nears, rows=rows)
        ties = ties_of(robot, q, start, targets.frame_time, stage.columns)
        return normal, ties, uniform_filter1d(normal.cost + ties.cost(len(q)), window)

    last = np.inf
    for k in range(most):
        if apart and k % 3 == 0:
            nears = robot.collisions.near(forward(tree, q), stage, stride_of(targets))
        normal, ties, cost = look(q, rows=True)
        limits = q.at_limits(tree, SHORT_OF_LIMIT)[:, stage.columns]
        step = np.zeros((len(q), tree.size))
        step[:, stage.columns] = normal.solve_together(ties, damping, limits)
        long = np.minimum(1.0, _LONGEST / np.maximum(np.abs(step).max(1), 1e-9))
        step *= eased(long, window)[:, None]
        trial = q.moved(tree, step).clipped(tree, SHORT_OF_LIMIT)
        worse = look(trial, rows=False)[2] > cost * (1 + 1e-3) + 1e-9
        damping = np.where(worse, damping * 10, np.maximum(damping / 5, _DAMPING))
        if worse.any():
            step *= eased(1.0 - worse, window)[:, None]
            trial = q.moved(tree, step).clipped(tree, SHORT_OF_LIMIT)
        q = trial
        if cost.sum() > (1 - little) * last:
            break
        last = float(cost.sum())
    return q


def eased(scale: Float[np.ndarray, "T"], window: int) -> Float[np.ndarray, "T"]:
    """A smooth curve that nowhere exceeds `scale`."""
    least = minimum_filter1d(scale, window, mode="nearest")
    return uniform_filter1d(least, window, mode="nearest")


def ties_of(
    robot: Morphology,
    q: Coordinates,
    start: Coordinates | None,
    frame_time: float,
    columns: list[int],
) -> Ties:
    """What ties the frames of `q` together, in some columns: it is smooth and, where there is a
    `start`, its difference to that is smoother still."""
    weights = smoothness(robot)[columns] / frame_time**2
    bends = accelerations(robot, q)[:, columns]
    if start is not None:
        # Two squares, w² |a|² + c² |a - a0|², are one around c² / (w² + c²) a0.
        share = 1.0 / (1.0 + (CALM / SMOOTH) ** 4)
        weights = weights / np.sqrt(1.0 - share)
        bends -= share * accelerations(robot, start)[:, columns]
    return Ties(
        weights,
        bends,
        RUSH / frame_time,
        rush(robot, q, frame_time)[:, columns],
    )


def unhurried(robot: Morphology, q: Coordinates, frame_time: float) -> Coordinates:
    """The nearest hinge angles that turn at most `FAST`: the mean of what is as fast above and
    below. Jumps from one limit to the other become ramps, which the solver can bend."""
    time = FAST * frame_time * np.arange(len(q))[:, None]

    def below(angles: Float[np.ndarray, "T N"]) -> Float[np.ndarray, "T N"]:
        ahead = np.minimum.accumulate(angles - time) + time
        return np.minimum.accumulate((ahead + time)[::-1])[::-1] - time

    angles = np.where(robot.tree.balls, q.angles, (below(q.angles) - below(-q.angles)) / 2)
    return Coordinates(q.pos, q.quat, angles, q.turns)


def smoothness(robot: Morphology) -> Float[np.ndarray, "D"]:
    """How accelerations weigh [s²], so that what is faster than `SMOOTH` fades."""
    weights = np.full(robot.tree.size, 1.0 / (2 * np.pi * SMOOTH) ** 2)
    weights[:3] *= PATH
    return weights


def accelerations(robot: Morphology, q: Coordinates) -> Float[np.ndarray, "A D"]:
    """Second differences of all columns; of rotations, the change of the turn between frames."""
    tree = robot.tree
    out = np.zeros((max(len(q) - 2, 0), tree.size))
    out[:, :3] = second_differences(q.pos)
    out[:, 3:6] = _turn_differences(q.quat)
    hinges = ~tree.balls
    out[:, tree.starts[hinges]] = second_differences(q.angles[:, hinges])
    for j in np.flatnonzero(tree.balls):
        assert q.turns is not None
        at = tree.starts[j]
        out[:, at : at + 3] = _turn_differences(q.turns[:, j])
    return out


def rush(robot: Morphology, q: Coordinates, frame_time: float) -> Float[np.ndarray, "V D"]:
    """By how much [rad] hinges turn further from frame to frame than they should."""
    tree = robot.tree
    out = np.zeros((max(len(q) - 1, 0), tree.size))
    hinges = ~tree.balls
    steps = np.diff(q.angles[:, hinges], axis=0)
    most = FAST * frame_time
    out[:, tree.starts[hinges]] = steps - np.clip(steps, -most, most)
    return out


def _turn_differences(q: Float[np.ndarray, "T 4"]) -> Float[np.ndarray, "A 3"]:
    if len(q) < 3:
        return np.zeros((0, 3))
    return np.diff(rotvec_from_quat(quat_mul(q[1:], quat_conj(q[:-1]))), axis=0)
