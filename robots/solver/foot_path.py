"""The way of each point of a sole, standing and swinging: what the whole body follows.

A standing foot stays on its footprint. A swinging one keeps the copied path, carried from the
footprint behind it to the one before it, and the source's clearance, scaled, over the ground that
the source climbs. An end of the foot that is fast is lifted, in time, so that it steps and does not
drag: who turns on the toes raises the heel.
"""

import numpy as np
from jaxtyping import Bool, Complex, Float
from scipy.ndimage import grey_dilation, median_filter

from robots.model.morphology import Morphology
from robots.solver.footholds import below_swing, over_edges
from robots.solver.footprints import FootPlan, on_points, on_prints
from robots.solver.holds import Holds
from robots.solver.settling import around, settled
from spark.runs import true_runs
from spark.smoothstep import smoothstep
from spark.transfer.footfalls import between_contacts

# How firmly the points of a sole are held, in x, y and z, as a share of those that stand:
SWING_HOLD = np.array([0.35, 0.35, 0.6])  # its height in swing is what keeps it off the floor,
SWING_REACH = 0.2  # [hip heights] over which that fades: a kick is a matter of limbs,
RAISED_HOLD = np.array([1.0, 1.0, 0.3])  # a standing foot's raised end turns about the other
STEP_HOLD = 1.0  # and the height of what steps,
IDLE_HOLD = 3.0  # or would drag, of who lies or kneels: nothing steps there
# Hip heights/s of an end of a foot, and hip heights that it then is above the floor: the report
# sees feet skate faster than 0.22 and lower than 0.028.
STEP_SPEEDS = (0.2, 0.3, 0.6)
STEP_HEIGHTS = (0.0, 0.03, 0.033)
# What is asked for is missed by some millimetres. The report sees a level foot skate, all of it
# below 0.044, whatever it carries. So such a foot steps higher, by this share. `LEVEL` is from its
# lowest point to its highest [hip heights], of a level foot and of one that is on its end.
LEVEL_LIFT = 0.18
LEVEL = (0.03, 0.06)
STEP_RISE = 0.33  # [hip heights/s] at which it is lifted before that and let down after it
UP_SHARE = 0.4  # of a contact, at each end, in which the foot may still, or already, be up
_LOW = 0.3  # of `SWING_REACH`: stated ground is as far below a foot as it is
SPEED_SPAN = 0.025  # [s] before and after a frame for a foot's speed
SETTLE = 0.11  # [s] before and after a contact in which a foot already stays, ever less,
SETTLE_HOLD = 0.65  # and is held along the floor ever less, up to this: at 1 it lands with a jerk
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
    way = toe + between_contacts(offset, stands, _gone(plan, offset))
    way = settled(way, stands, plan.frame_time, SETTLE)
    pivot, heading = way[:, 0] + 1j * way[:, 1], way[:, 2]
    turn = np.exp(1j * (heading - plan.heading))[:, None]
    copied = plan.points[..., 0] + 1j * plan.points[..., 1]
    own = pivot[:, None] + turn * (copied - copied_toe[:, None])
    flat = on_prints(plan.flat, pivot, heading)
    pitched = plan.points[..., 2] - plan.points[..., 2].min(axis=1, keepdims=True)
    on = on_points(plan.sole, plan.contacts.T.astype(np.float64)).T > 0
    low = on | (pitched < STEP_HEIGHTS[1] * plan.hip_height)
    step = _steps(plan, np.where(on, flat, own), low) * _higher(plan, pitched)[:, None]
    on &= step < _ON_FLOOR
    place = np.where(on, flat, own)
    lift = _in_time(step, plan)
    height = _height(plan)
    if plan.around is None:
        z = np.where(on, lift, pitched + np.maximum(height[:, None], lift))
        holds = _shares(plan, on, height, lift)
    else:
        z, holds = _over_ground(plan, on, place, pitched, height, lift)
    positions = np.stack([place.real, place.imag, z + plan.ground[:, None]], axis=-1)
    over_time = (np.ascontiguousarray(x.transpose(1, 2, 0)) for x in (positions, holds))
    links, points = robot.sole_points(plan.sole)
    return Holds(links, np.repeat(points[:, :, None], len(positions), axis=2), *over_time)


def _over_ground(
    plan: FootPlan,
    on: Bool[np.ndarray, "T P"],
    place: Complex[np.ndarray, "T P"],
    pitched: Float[np.ndarray, "T P"],
    height: Float[np.ndarray, "T"],
    lift: Float[np.ndarray, "T P"],
) -> tuple[Float[np.ndarray, "T P"], Float[np.ndarray, "T P 3"]]:
    """How high points are over `plan.ground` [m] on stated ground, and how firmly they are held. A
    foot is lifted over what is below it there, not over what lies between two footprints."""
    below = below_swing(plan, place, height + plan.ground) - plan.ground
    below = np.where(plan.stands, 0.0, below)
    low = height - below
    near = near_floor(low.clip(0.0) / (_LOW * plan.hip_height))
    lift = lift * np.where(plan.stands, 1.0, near)[:, None]
    z = np.where(on, lift, pitched + np.maximum(height[:, None], below[:, None] + lift))
    if plan.relief is not None:
        lowest = np.take_along_axis(plan.relief, pitched.argmin(axis=1)[:, None], 1)
        z += np.where(on, plan.relief, lowest)
    over = over_edges(plan, place, z + plan.ground[:, None])[:, None]
    holds = _shares(plan, on, low, np.maximum(lift, over))
    return z + over, holds


def _shares(
    plan: FootPlan,
    on: Bool[np.ndarray, "T P"],
    height: Float[np.ndarray, "T"],
    lift: Float[np.ndarray, "T P"],
) -> Float[np.ndarray, "T P 3"]:
    """How firmly points are held that are `on` the floor or not, of a foot at a `height` [m] whose
    ends are lifted [m]. Along the floor one that comes to stand, or leaves, is so ever more firmly:
    it would be late, and slide where it comes down."""
    swings = near_floor(height / plan.hip_height)[:, None] * SWING_HOLD
    near = around(plan.stands, plan.frame_time, SETTLE)[:, None]
    swings[:, :2] += near * np.maximum(SETTLE_HOLD - swings[:, :2], 0.0)
    stands = np.any(on, axis=1)[:, None]
    holds = np.where(on[..., None], 1.0, np.where(stands, RAISED_HOLD, swings)[:, None])
    up = np.minimum(lift / (STEP_HEIGHTS[1] * plan.hip_height), 1.0)
    firm = STEP_HOLD + (IDLE_HOLD - STEP_HOLD) * plan.idle[:, None]
    holds[..., 2] += up * (firm - holds[..., 2])
    return holds


def _gone(plan: FootPlan, offset: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T 3"]:
    """The copied toe [m], and beside it how far the foot is carried from that, at an even pace from
    one footprint to the next: one that hardly goes itself would be thrown there as soon as it does.
    """
    at = np.flatnonzero(plan.stands)
    if not len(at):
        return np.column_stack([plan.toe, np.zeros(len(plan.toe))])
    between = np.diff(offset[at] * [1.0, 1.0, plan.length], axis=0)
    carried = np.append(0.0, np.cumsum(np.linalg.norm(between, axis=1)))
    return np.column_stack([plan.toe, np.interp(np.arange(len(plan.toe)), at, carried)])


def near_floor(height: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """The share of its hold that a swinging foot keeps, which is so high [hip heights]: a robot
    that can't kick as high would be drawn into the air."""
    share: Float[np.ndarray, "*n"] = 1 / (1 + (height / SWING_REACH) ** 2)
    return share


def _height(plan: FootPlan) -> Float[np.ndarray, "T"]:
    """How high the lowest point of the sole is [m], as the source's is."""
    stands, reach = plan.stands, max(1, round(LET_DOWN / plan.frame_time))
    ground = np.zeros(len(stands))
    for start, stop in true_runs(stands):
        ground[start:stop] = plan.clearance[start:stop].min()
    ground = between_contacts(ground[:, None], stands, plan.toe)[:, 0]
    clearance = plan.clearance - ground
    drop = np.where(stands, clearance, 0.0)
    clearance = clearance - _fading(drop, stands, reach)
    away = 1 - np.minimum(_fading(stands * 1.0, stands, reach), 1.0)
    pace = _speeds(plan.toe[:, :1] + 1j * plan.toe[:, 1:], plan.frame_time)[:, 0]
    steps = np.interp(pace / plan.hip_height, [STEP_SPEEDS[0], STEP_SPEEDS[-1]], [0.0, 1.0])
    uneven = away * steps * np.minimum(ground, MAX_UNEVEN * plan.hip_height)
    return np.where(stands, 0.0, clearance + uneven + plan.lift)


def _steps(
    plan: FootPlan, points: Complex[np.ndarray, "T P"], low: Bool[np.ndarray, "T P"]
) -> Float[np.ndarray, "T P"]:
    """How high [m] heel, ball and toes step, each as its faster side asks where that is low."""
    speeds = np.where(low, _speeds(points, plan.frame_time), 0.0)
    creep = max(1, round(MIN_CREEP / plan.frame_time))
    for start, stop in true_runs(plan.stands):
        own = slice(start, stop)  # how it comes and leaves is no creep
        standing = np.where(low[own], _speeds(points[own], plan.frame_time), 0.0)
        speeds[own] = median_filter(standing, (creep, 1), mode="nearest")
    ends = speeds.reshape(len(speeds), -1, 2).max(axis=2)
    return np.repeat(step_height(ends, plan.hip_height), 2, axis=1)


def _higher(plan: FootPlan, pitched: Float[np.ndarray, "T P"]) -> Float[np.ndarray, "T"]:
    """Times as high as others a foot steps that swings and is level: its points are so high [m]
    over the lowest of them."""
    tilt, (low, high) = pitched.max(axis=1) / plan.hip_height, LEVEL
    level = 1.0 - smoothstep((tilt - low) / (high - low))
    return 1.0 + LEVEL_LIFT * np.where(plan.stands, 0.0, level)


def _in_time(step: Float[np.ndarray, "T P"], plan: FootPlan) -> Float[np.ndarray, "T P"]:
    """At least so high [m], rising and falling no faster than `STEP_RISE`; but a contact's middle
    is only as high as given."""
    rise, top = STEP_RISE * plan.hip_height * plan.frame_time, step.max(initial=0.0)
    reach = int(top / rise)
    cone = -rise * np.abs(np.arange(-reach, reach + 1))[:, None]
    # The stubs of scipy want whole numbers there.
    lifted: Float[np.ndarray, "T P"] = grey_dilation(step, structure=cone)  # type: ignore[arg-type]
    for start, stop in true_runs(plan.stands):
        own, frames = slice(start, stop), np.arange(stop - start)
        inside = (1 + np.minimum(frames, frames[::-1])) / (UP_SHARE * len(frames))
        most = top * np.maximum(1 - inside, 0.0)[:, None]
        lifted[own] = np.maximum(step[own], np.minimum(lifted[own], most))
    return lifted


def step_height(speed: Float[np.ndarray, "*n"], hip_height: float) -> Float[np.ndarray, "*n"]:
    """How high [m] a foot steps that is so fast [m/s], so that it does not drag."""
    height: Float[np.ndarray, "*n"] = np.interp(speed / hip_height, STEP_SPEEDS, STEP_HEIGHTS)
    return height * hip_height


def _speeds(points: Complex[np.ndarray, "T P"], frame_time: float) -> Float[np.ndarray, "T P"]:
    """Over the floor [m/s]; one-sided at the ends."""
    reach, frames = max(1, round(SPEED_SPAN / frame_time)), np.arange(len(points))
    after, before = np.minimum(frames + reach, len(frames) - 1), np.maximum(frames - reach, 0)
    span = np.maximum((after - before) * frame_time, 1e-9)
    speeds: Float[np.ndarray, "T P"] = np.abs(points[after] - points[before]) / span[:, None]
    return speeds


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
        share = smoothstep(1 - np.abs(frames - near) / reach)
        inside = (k >= 0) & (k < len(at))
        out += np.where(inside & ~stands, values[near] * share, 0.0)
    return out
