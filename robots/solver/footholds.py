"""Feet on stated ground: footprints that stand on what is there, and swings that clear its edges.

A robot's foot comes down a few centimetres from where its source's does, scaled. Over an edge it is
shifted until most of it is on top, or out of the wall that it would be in.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Complex, Float
from scipy.ndimage import grey_dilation

from robots.solver.footprints import FootPlan
from spark.runs import true_runs
from spark.terrain import Terrain
from spark.transfer.footfalls import between_contacts

# All lengths are in hip heights.
_LEVEL = 0.06  # up or down within which what is below a footprint carries it
_SHIFT, _STEPS = 0.16, 17  # by which a footprint may be shifted, and how many tries that is across
_BESIDE = 0.03  # around a sole, in which nothing is higher than it stands
_ENOUGH = 0.65  # of a sole that has to be carried: one may stand half over an edge
_W_CARRIED, _W_BLOCKED = 3.0, 6.0  # of what of it isn't, or is blocked, against the largest shift
_WALL = 0.6  # over a footprint, up to which what is there blocks it
_FLAT = 0.003  # of height that a sole feels
_CLEAR = 0.015  # between a swinging foot and an edge
_OVER = 0.15  # that it may be below that: what is deeper in a wall is pushed out by it
_RISE = 1.5  # [hip heights/s] at which it is lifted before an edge, and let down after it
_STEEP = 1.0  # [1] of the steepest ground that a sole lies on


def on_ground(plan: FootPlan) -> FootPlan:
    """A foot whose footprints are on stated ground, where there is any."""
    if plan.around is None:
        return plan
    terrain = plan.around.terrain
    prints, ground, contacts = plan.prints.copy(), plan.ground.copy(), plan.contacts.copy()
    relief = np.zeros((len(prints), len(plan.flat)))
    for start, stop in true_runs(plan.stands):
        own, height = slice(start, stop), float(np.median(ground[start:stop]))
        toe, heading = prints[own, :2].mean(axis=0) @ [1, 1j], float(prints[own, 2].mean())
        shift = _shift(terrain, plan, toe, heading, height)
        prints[own, :2] += [shift.real, shift.imag]
        level, relief[own] = _under(terrain, plan, toe + shift, heading, height)
        ground[own] = level
        carried = _carried(terrain, plan, toe + shift, heading, level)
        if not carried.all():
            contacts[own] |= carried
    ground = between_contacts(ground[:, None], plan.stands, plan.toe)[:, 0]
    return replace(plan, prints=prints, ground=ground, contacts=contacts, relief=relief)


def _shift(
    terrain: Terrain, plan: FootPlan, toe: complex, heading: float, height: float
) -> complex:
    """By how much [m] a footprint goes to where most of it is carried and nothing blocks it."""
    if not _misfits(terrain, plan, np.array([toe]), heading, height).any():
        return 0j
    most = _SHIFT * plan.hip_height
    steps = np.linspace(-most, most, _STEPS)
    tries = (steps[:, None] + 1j * steps).ravel()
    tries = tries[np.abs(tries) <= most]
    cost = np.abs(tries) / most + _misfits(terrain, plan, toe + tries, heading, height)
    return complex(tries[cost.argmin()])


def _misfits(
    terrain: Terrain,
    plan: FootPlan,
    toes: Complex[np.ndarray, "N"],
    heading: float,
    height: float,
) -> Float[np.ndarray, "N"]:
    """What speaks against footprints in some places."""
    size = plan.hip_height
    sole, wide = (_sole(plan, margin, heading) for margin in (0.0, _BESIDE * size))
    carried = np.abs(_tops(terrain, toes[:, None] + sole, height, _WALL * size) - height)
    blocked = _tops(terrain, toes[:, None] + wide, height, _WALL * size) - height
    share = (carried < _LEVEL * size).mean(axis=1)
    return _W_CARRIED * np.maximum(1.0 - share / _ENOUGH, 0.0) + _W_BLOCKED * (
        blocked > _LEVEL * size
    ).mean(axis=1)


def _under(
    terrain: Terrain, plan: FootPlan, toe: complex, heading: float, height: float
) -> tuple[float, Float[np.ndarray, "P"]]:
    """How high [m] what carries a footprint is, and by how much higher below each of its points:
    where it is not level, on the plane through it."""
    size = plan.hip_height
    places = toe + _sole(plan, 0.0, heading)
    tops = _tops(terrain, places, height, _LEVEL * size)
    carry = np.abs(tops - height) < _LEVEL * size
    none = np.zeros(len(plan.flat))
    if not carry.any():
        return height, none
    level = float(np.median(tops[carry]))
    if carry.sum() < 4 or np.ptp(tops[carry]) < _FLAT * size:
        return level, none
    middle = places[carry].mean()
    away = places[carry] - middle
    rows = np.column_stack([np.ones(len(away)), away.real, away.imag])
    plane = np.linalg.lstsq(rows, tops[carry], rcond=None)[0]
    if np.hypot(*plane[1:]) > _STEEP:
        return level, none
    corners = toe + np.exp(1j * heading) * (plan.flat @ [1, 1j]) - middle
    return float(plane[0]), plane[1] * corners.real + plane[2] * corners.imag


def _carried(
    terrain: Terrain, plan: FootPlan, toe: complex, heading: float, level: float
) -> Bool[np.ndarray, "2"]:
    """Whether there is ground below the heel and below the toes of a footprint: one that is over an
    edge can't carry a foot alone, and the other end stands, too."""
    points = toe + np.exp(1j * heading) * (plan.flat @ [1, 1j])
    tops = _tops(terrain, points, level, _LEVEL * plan.hip_height)
    carry = np.abs(tops - level) < _LEVEL * plan.hip_height
    return np.array([carry[:2].any(), carry[-2:].any()])


def _sole(plan: FootPlan, margin: float, heading: float) -> Complex[np.ndarray, "K"]:
    """Points all over a sole, and a margin [m] around it, from the middle of its toes."""
    low, high = plan.flat.min(axis=0) - margin, plan.flat.max(axis=0) + margin
    x, y = (np.linspace(a, b, n) for a, b, n in zip(low, high, (7, 4), strict=True))
    grid = (x[:, None] + 1j * y).ravel()
    out: Complex[np.ndarray, K] = grid * np.exp(1j * heading)
    return out


def _tops(
    terrain: Terrain, places: Complex[np.ndarray, "*n"], height: float, above: float
) -> Float[np.ndarray, "*n"]:
    """The highest ground [m] at places that is at most so far above a height, or the floor."""
    points = np.stack([places.real, places.imag, np.full(places.shape, height)], axis=-1)
    return np.maximum(terrain.tops(points, above), 0.0)


def below_swing(
    plan: FootPlan, places: Complex[np.ndarray, "T P"], z: Float[np.ndarray, "T"]
) -> Float[np.ndarray, "T"]:
    """How high [m] what is below a foot is that is at `places`, its lowest point at `z` [m]."""
    assert plan.around is not None
    heights = np.repeat(z[:, None], places.shape[1], axis=1)
    points = np.stack([places.real, places.imag, heights], axis=-1)
    tops = plan.around.terrain.tops(points, _LEVEL * plan.hip_height)
    return np.maximum(tops.max(axis=1), 0.0)


def over_edges(
    plan: FootPlan, places: Complex[np.ndarray, "T P"], z: Float[np.ndarray, "T P"]
) -> Float[np.ndarray, "T"]:
    """By how much [m] a foot that swings is lifted over edges; its points are at `places`, and so
    high [m]. It rises before and comes down after, at `_RISE`."""
    assert plan.around is not None
    size = plan.hip_height
    middle = places.mean(axis=1, keepdims=True)
    away = places - middle
    wide = middle + away * (1.0 + _BESIDE * size / np.maximum(np.abs(away), 1e-9))
    points = np.stack([wide.real, wide.imag, z], axis=-1)
    tops = plan.around.terrain.tops(points, _OVER * size)
    missing = np.where(plan.stands[:, None], 0.0, tops + _CLEAR * size - z).max(axis=1).clip(0.0)
    rise = _RISE * size * plan.frame_time
    reach = int(missing.max(initial=0.0) / rise)
    cone = -rise * np.abs(np.arange(-reach, reach + 1))
    lifted: Float[np.ndarray, T] = grey_dilation(missing, structure=cone)  # type: ignore[arg-type]
    return np.where(plan.stands, 0.0, lifted)
