"""What ties the frames of a robot's trajectory together: it is smooth, without jolts and haste."""

import numpy as np
from jaxtyping import Float
from scipy.ndimage import uniform_filter1d

from robots.least_squares import Smoothness, second_differences
from robots.model.morphology import Morphology
from robots.solver.objective import ANKLE, CALM, FAST, JOLT, PATH, RUSH, SMOOTH
from robots.tree import Coordinates
from spark.rig.roles import Role
from spark.rotation import quat_conj, quat_mul, rotvec_from_quat

_AROUND = 0.15  # [s] before and after a jolt that are smoothed with it


def ties_of(
    robot: Morphology,
    q: Coordinates,
    start: Coordinates | None,
    frame_time: float,
    columns: list[int],
    stiffer: Float[np.ndarray, "A C"],
    firm: Float[np.ndarray, "T"],
) -> Smoothness:
    """What ties the frames of `q` together, in some columns: it is smooth and, where there is a
    `start`, its difference to that is smoother still."""
    weights = stiffer * smoothness(robot)[columns] / frame_time**2
    bends = accelerations(robot, q)[:, columns]
    if start is not None:
        # Two squares, w² |a|² + c² |a - a0|², are one around c² / (w² + c²) a0.
        share = 1.0 / (1.0 + stiffer**2 * (CALM / SMOOTH) ** 4)
        weights = weights / np.sqrt(1.0 - share)
        bends -= share * accelerations(robot, start)[:, columns]
    return Smoothness(
        weights,
        bends,
        RUSH / frame_time * firm[1:, None],
        rush(robot, q, frame_time)[:, columns],
    )


def jolted(robot: Morphology, q: Coordinates, frame_time: float) -> Float[np.ndarray, "A D"]:
    """How much stiffer accelerations of hinges have to be where these jolt: by the jerk around
    them, over `JOLT`."""
    tree = robot.tree
    out = np.ones((max(len(q) - 2, 0), tree.nv))
    hinges = ~tree.balls
    if len(q) > 3:
        jerk = np.diff(q.angles[:, hinges], 3, axis=0) / frame_time**3
        window = max(1, 2 * round(_AROUND / frame_time) + 1)
        mean = uniform_filter1d(jerk**2, window, axis=0, mode="nearest")
        around = np.sqrt(np.maximum(mean, 0.0))
        around = np.concatenate([around[:1], around])
        out[:, tree.dof_starts[hinges]] = np.maximum(around / JOLT, 1.0)
    return out


def unhurried(robot: Morphology, q: Coordinates, frame_time: float) -> Coordinates:
    """The nearest hinge angles that turn at most `FAST`: the mean of what is as fast above and
    below. Jumps from one limit to the other become ramps, which the solver can bend."""
    time = FAST * frame_time * np.arange(len(q))[:, None]

    def below(angles: Float[np.ndarray, "T N"]) -> Float[np.ndarray, "T N"]:
        ahead = np.minimum.accumulate(angles - time) + time
        return np.minimum.accumulate((ahead + time)[::-1])[::-1] - time

    angles = np.where(robot.tree.balls, q.angles, (below(q.angles) - below(-q.angles)) / 2)
    return Coordinates(q.pos, q.quat, angles, q.ball_quats)


def smoothness(robot: Morphology) -> Float[np.ndarray, "D"]:
    """How accelerations weigh [s²], so that what is faster than `SMOOTH` fades; those of what turns
    a foot alone less, since that is wished for less firmly than the direction of a limb."""
    weights = np.full(robot.tree.nv, 1.0 / (2 * np.pi * SMOOTH) ** 2)
    weights[:3] *= PATH
    roles, tree = robot.rig.roles, robot.tree
    for side in ("left", "right"):
        shank, foot = (roles.joint(Role(f"{side}_{part}")) for part in ("lower_leg", "foot"))
        if shank is None or foot is None:
            continue
        above = tree.chain(int(robot.links[shank]))
        alone = tuple(j for j in tree.chain(int(robot.links[foot])) if j not in above)
        weights[tree.dofs(alone)] *= ANKLE
    return weights


def accelerations(robot: Morphology, q: Coordinates) -> Float[np.ndarray, "A D"]:
    """Second differences of all columns; of rotations, the change of the turn between frames."""
    tree = robot.tree
    out = np.zeros((max(len(q) - 2, 0), tree.nv))
    out[:, :3] = second_differences(q.pos)
    out[:, 3:6] = _turn_differences(q.quat)
    hinges = ~tree.balls
    out[:, tree.dof_starts[hinges]] = second_differences(q.angles[:, hinges])
    for j in np.flatnonzero(tree.balls):
        assert q.ball_quats is not None
        at = tree.dof_starts[j]
        out[:, at : at + 3] = _turn_differences(q.ball_quats[:, j])
    return out


def rush(robot: Morphology, q: Coordinates, frame_time: float) -> Float[np.ndarray, "V D"]:
    """By how much [rad] hinges turn further from frame to frame than they should."""
    tree = robot.tree
    out = np.zeros((max(len(q) - 1, 0), tree.nv))
    hinges = ~tree.balls
    steps = np.diff(q.angles[:, hinges], axis=0)
    most = FAST * frame_time
    out[:, tree.dof_starts[hinges]] = steps - np.clip(steps, -most, most)
    return out


def _turn_differences(q: Float[np.ndarray, "T 4"]) -> Float[np.ndarray, "A 3"]:
    if len(q) < 3:
        return np.zeros((0, 3))
    return np.diff(rotvec_from_quat(quat_mul(q[1:], quat_conj(q[:-1]))), axis=0)
