"""How far from its ankle a foot may be pushed: as far as the ankle's motors hold it.

The floor pushes a sole at its centre of pressure. Many ankles don't hold the body over the toes: an
H1's give 40 N m, which carry its weight 8 cm from the ankle, on a sole that reaches 15 cm ahead.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Complex, Float

from robots.kinematics import forward_kinematics
from robots.model.morphology import Morphology
from sim.physics.servos import torque_limit
from spark.constants import GRAVITY
from spark.rig.feet import Sole

_LOAD = 1.1  # [body weights] that a foot carries in a step, alone
_LEAST = 0.02  # [hip heights] of reach without which nobody stands: less is no motor's limit


def within_ankles(
    robot: Morphology,
    soles: Sequence[Sole],
    points: Float[np.ndarray, "T K 2"],
    touching: Bool[np.ndarray, "T K"],
) -> Float[np.ndarray, "T K 2"]:
    """Where these soles may be pushed, all of whose `points` [m] may be while they touch: no
    further from the ankle than it holds a body that stands on this foot alone, or at the nearest
    that touches. Where no motor of an ankle tells what it gives, wherever they touch."""
    reaches = [_reach(robot, sole) for sole in soles]
    if not np.isfinite(reaches).any():
        return points
    ends = np.cumsum([len(sole) for sole in soles])[:-1]
    feet = zip(soles, np.split(points, ends, axis=1), np.split(touching, ends, axis=1), strict=True)
    pushed = [
        _within(_ankle(robot, sole), own @ np.array([1, 1j]), on, reach)
        for (sole, own, on), reach in zip(feet, reaches, strict=True)
    ]
    placed = np.concatenate(pushed, axis=1)
    return np.stack([placed.real, placed.imag], axis=-1)


def _within(
    ankle: float,
    points: Complex[np.ndarray, "T P"],
    touching: Bool[np.ndarray, "T P"],
    reach: Float[np.ndarray, "2"],
) -> Complex[np.ndarray, "T P"]:
    """A sole's points within `reach` [m] of its ankle, along the foot and across it; that is the
    share `ankle` of the way from the heel to the toes."""
    heel, toes = points[:, :2].mean(axis=1), points[:, -2:].mean(axis=1)
    middle = (heel + ankle * (toes - heel))[:, None]
    ahead = ((toes - heel) / np.maximum(np.abs(toes - heel), 1e-9))[:, None]
    away = (points - middle) * ahead.conj()
    along, across = (
        _clipped(x, touching, float(most))
        for x, most in zip((away.real, away.imag), reach, strict=True)
    )
    return np.where(touching, middle + ahead * (along + 1j * across), points)


def _clipped(
    away: Float[np.ndarray, "T P"], touching: Bool[np.ndarray, "T P"], most: float
) -> Float[np.ndarray, "T P"]:
    """Places no further `away` than `most` to either side, or than the nearest that touches."""
    least = np.where(touching, away, np.inf).min(axis=1, keepdims=True)
    largest = np.where(touching, away, -np.inf).max(axis=1, keepdims=True)
    out: Float[np.ndarray, "T P"] = np.clip(
        away, np.minimum(-most, largest), np.maximum(most, least)
    )
    return out


def _ankle(robot: Morphology, sole: Sole) -> float:
    """Where the ankle is over the sole: as a share of the way from the heel to the toes."""
    points = robot.sole_points(sole)[1]
    heel = points[:2].mean(axis=0)
    along = points[-2:].mean(axis=0) - heel
    from_heel = robot.rig.skeleton.rest_positions[sole.foot] - heel
    return float(from_heel @ along / max(along @ along, 1e-12))


@lru_cache(maxsize=16)
def _reach(robot: Morphology, sole: Sole) -> Float[np.ndarray, "2"]:
    """How far [m] from its ankle a sole can carry the body, along the foot and across it."""
    model, tree = robot.whole.model, robot.tree
    foot, shank = robot.links[[sole.foot, robot.rig.skeleton.parents[sole.foot]]].tolist()
    weight = float(model.body_subtreemass[robot.whole.root]) * GRAVITY
    poses, out = forward_kinematics(tree, robot.tpose), np.full(2, np.inf)
    for joint in set(tree.chain(foot)) - set(tree.chain(shank)):
        limit = torque_limit(model, robot.mj_joints[joint])
        reach = (limit or np.inf) / (_LOAD * weight)
        if reach > _LEAST * robot.rig.hip_height and not tree.balls[joint]:
            ahead, left = np.abs(poses.axis(joint, 0)[:2, 0])
            across = int(ahead > left)
            out[across] = min(out[across], reach)
    return out
