"""The way of each point of a sole, standing and swinging: what the whole body follows.

A standing foot stays on its footprint. A swinging one keeps the copied path, carried from the
footprint behind it to the one before it, and the source's clearance, scaled. Ground on which the
source climbs is level under the robot. Where a foot is fast it is lifted, so that it steps and does
not drag.
"""

import numpy as np
from jaxtyping import Bool, Complex, Float
from scipy.ndimage import median_filter

from robots.model.morphology import Morphology
from robots.solver.footprints import FootPlan, on_points, on_prints
from robots.solver.holds import Holds
from robots.solver.settling import settled
from spark.runs import true_runs
from spark.transfer.footfalls import between_contacts

# How firmly the points of a sole are held, in x, y and z, as a share of those that stand:
SWING_HOLD = np.array([0.35, 0.35, 0.6])  # its height in swing is what keeps it off the floor,
SWING_REACH = 0.2  # [hip heights] over which that fades: a kick is a matter of limbs,
RAISED_HOLD = np.array([1.0, 1.0, 0.3])  # a standing foot's raised end turns about the other
# Hip heights/s of a foot, and hip heights that it then is above the floor: the report sees feet
# skate faster than 0.22 and lower than 0.028.
STEP_SPEEDS = (0.2, 0.3, 0.6)
STEP_HEIGHTS = (0.0, 0.03, 0.033)
SPEED_SPAN = 0.025  # [s] before and after a frame for a foot's speed
SETTLE = 0.1  # [s] before and after a contact in which a foot already stays, ever less
MIN_CREEP = 0.08  # [s], half of which a standing foot has to move for before it is lifted
LET_DOWN = 0.15  # [s] within which a foot comes down that is in the air where its contact begins
# Hip heights above the floor at which a foot may stand on it: skeletons and recorded floors are off
# by that. What it stands higher is ground, and so is all where it takes no step.
MAX_UNEVEN = 0.06
_ON_FLOOR = 1e-3  # [m]


def footing_of(robot: Morphology, plan: FootPlan) -> Holds:
    """Where the points of a planned foot's sole are held."""
    stands = plan.stands
    toe, copied_toe = np.column_stack([plan.toe, plan.heading]), plan.toe @ [1, 1j]
    offset = plan.prints - toe
    offset[:, 2] = np.remainder(offset[:, 2] + np.pi, 2 * np.pi) - np.pi
    way = toe + between_contacts(offset, stands, plan.toe)
    way = settled(way, stands, plan.frame_time, SETTLE)
    pivot, heading = way[:, 0] + 1j * way[:, 1], way[:, 2]
    turn = np.exp(1j * (heading - plan.heading))[:, None]
    copied = plan.points[..., 0] + 1j * plan.points[..., 1]
    own = pivot[:, None] + turn * (copied - copied_toe[:, None])
    flat = on_prints(plan.flat, pivot, heading)
    pitched = plan.points[..., 2] - plan.points[..., 2].min(axis=1, keepdims=True)
    on = on_points(plan.sole, plan.contacts.T.astype(np.float64)).T > 0
    low = np.where(stands[:, None], on, pitched < STEP_HEIGHTS[1] * plan.hip_height)
    height = _height(plan, np.where(on, flat, own), low)
    stands = stands & (height < _ON_FLOOR)
    on = on & stands[:, None]
    place = np.where(on, flat, own)
    z = np.where(on, 0.0, pitched + height[:, None])
    near = near_floor(height / plan.hip_height)[:, None, None]
    holds = np.where(stands[:, None, None], RAISED_HOLD, near * SWING_HOLD)
    holds = np.where(on[..., None], 1.0, holds)
    positions = np.stack([place.real, place.imag, z], axis=-1)
    over_time = (np.ascontiguousarray(x.transpose(1, 2, 0)) for x in (positions, holds))
    return Holds(*robot.sole_points(plan.sole), *over_time)


def near_floor(height: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """The share of its hold that a swinging foot keeps, which is so high [hip heights]: a robot
    that can't kick as high would be drawn into the air."""
    share: Float[np.ndarray, "*n"] = 1 / (1 + (height / SWING_REACH) ** 2)
    return share


def _height(
    plan: FootPlan, points: Complex[np.ndarray, "T P"], low: Bool[np.ndarray, "T P"]
) -> Float[np.ndarray, "T"]:
    """How high the lowest point of the sole is [m]; `low` points are on the floor, or near it."""
    stands, reach = plan.stands, max(1, round(LET_DOWN / plan.frame_time))
    ground = np.zeros(len(stands))
    for start, stop in true_runs(stands):
        ground[start:stop] = plan.clearance[start:stop].min()
    ground = between_contacts(ground[:, None], stands, plan.toe)[:, 0]
    clearance = plan.clearance - ground
    drop = np.where(stands, clearance, 0.0)
    clearance = clearance - _fading(drop, stands, reach)
    away = 1 - np.minimum(_fading(stands * 1.0, stands, reach), 1.0)
    pivot = (plan.toe[:, 0] + 1j * plan.toe[:, 1])[:, None]
    pace = _speed(pivot, np.ones_like(low[:, :1]), plan.frame_time, SPEED_SPAN) / plan.hip_height
    steps = np.interp(pace, [STEP_SPEEDS[0], STEP_SPEEDS[-1]], [0.0, 1.0])
    uneven = away * steps * np.minimum(ground, MAX_UNEVEN * plan.hip_height)
    height = np.where(stands, 0.0, clearance + uneven + plan.lift)
    speed = _speed(points, low, plan.frame_time, SPEED_SPAN)
    creep = max(1, round(MIN_CREEP / plan.frame_time))
    for start, stop in true_runs(stands):
        own = slice(start, stop)  # how it comes and leaves is no creep
        standing = _speed(points[own], low[own], plan.frame_time, SPEED_SPAN)
        speed[own] = median_filter(standing, creep, mode="nearest")
    return np.maximum(height, step_height(speed, plan.hip_height))


def step_height(speed: Float[np.ndarray, "*n"], hip_height: float) -> Float[np.ndarray, "*n"]:
    """How high [m] a foot steps that is so fast [m/s], so that it does not drag."""
    height: Float[np.ndarray, "*n"] = np.interp(speed / hip_height, STEP_SPEEDS, STEP_HEIGHTS)
    return height * hip_height


def _speed(
    points: Complex[np.ndarray, "T P"],
    low: Bool[np.ndarray, "T P"],
    frame_time: float,
    span: float,
) -> Float[np.ndarray, "T"]:
    """Of the fastest low point over the floor [m/s]; one-sided at the ends."""
    reach, frames = max(1, round(span / frame_time)), np.arange(len(points))
    after, before = np.minimum(frames + reach, len(frames) - 1), np.maximum(frames - reach, 0)
    way = np.where(low, np.abs(points[after] - points[before]), 0.0).max(axis=1)
    speed: Float[np.ndarray, T] = way / np.maximum((after - before) * frame_time, 1e-9)
    return speed


def _fading(
    values: Float[np.ndarray, "T"], stands: Bool[np.ndarray, "T"], reach: int
) -> Float[np.ndarray, "T"]:
    """In swing, the values at the end of the contact before and at the beginning of the one after,
    fading over some frames (a smoothstep)."""
    frames, at = np.arange(len(values)), np.flatnonzero(stands)
    out = np.zeros(len(values))
    if not len(at):
        return out
    for side in ("right", "left"):
        k = np.searchsorted(at, frames, side=side) - (side == "right")
        near = at[np.clip(k, 0, len(at) - 1)]
        share = np.clip(1 - np.abs(frames - near) / reach, 0.0, 1.0)
        inside = (k >= 0) & (k < len(at))
        out += np.where(inside & ~stands, values[near] * share**2 * (3 - 2 * share), 0.0)
    return out
