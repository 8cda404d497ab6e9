"""A motion on stated ground: where its floor is, and what is under each foot.

What a recording says of heights is off by centimetres: soles are drawn, and boxes measured. So a
foot that is still, and near the ground below it, stands on that; and the body is as high over it as
the soles are drawn over, or in, it.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import gaussian_filter1d

from spark.errors import ConventionError
from spark.rig.contacts import ADULT_HEIGHT
from spark.runs import true_runs
from spark.terrain import Terrain
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.footfalls import between_contacts, with_ends
from spark.transfer.soles import SAME_HEIGHT, sole_paths, still_feet

# All lengths [m] are of an adult.
_REACH = 0.15  # over a foot, and below it, within which it stands on what is there
_MISFIT = 0.08  # by which a foot may be higher or lower over it than others are
_EDGE = 0.09  # from the middle of a foot to an end, up or down, beyond which that is over an edge
_BASE = 0.15  # from where feet stand to the floor that the file, or the terrain's base, says
_NOWHERE = 3.0  # from the terrain to the nearest footfall, of a terrain that is not the motion's
_INSIDE = 0.5  # of the time in which hips are in it, of one that is not the motion's either
_OFF = 0.05  # between drawn soles and the ground, which a note tells
_DRAWN = 0.5  # [s] over which the body is brought from one height over the ground to another


class Footholds(NamedTuple):
    """Of a rig's feet over time: when each `stands`, the `heights` [m, world] of what is below it,
    and by how much that is higher at heel and toe (`relief`)."""

    stands: Bool[np.ndarray, "T S"]
    heights: Float[np.ndarray, "T S"]
    relief: Float[np.ndarray, "T S 2"]

    @property
    def lowest(self) -> Float[np.ndarray, "T S"]:
        """The height [m, world] of what is below the lowest point of a foot that lies on it."""
        return self.heights + np.minimum(self.relief.min(axis=2), 0.0)


def footholds(
    terrain: Terrain,
    floor_z: float,
    paths: Float[np.ndarray, "T S 2 3"],
    lowest: Float[np.ndarray, "T S"],
    still: Bool[np.ndarray, "T S"],
    scale: float,
    misfit: float = _MISFIT,
) -> Footholds:
    """Where feet stand that are `still`, of an adult times `scale`: heels and toes are at `paths`,
    and the lowest points of the soles so high [m, world]. A foot may stand on the nearest of what
    is below its heel, its middle and its toe."""
    stands, heights = np.zeros_like(still), np.full(still.shape, floor_z)
    relief = np.zeros((*still.shape, 2))
    middles = paths.mean(axis=2, keepdims=True)
    points = np.concatenate([paths, middles], axis=2)
    points[..., 2] = lowest[..., None]
    tops = np.maximum(terrain.tops(points, _REACH * scale), floor_z)
    for k in range(still.shape[1]):
        for start, stop in true_runs(still[:, k]):
            below, low = np.median(tops[start:stop, k], axis=0), np.median(lowest[start:stop, k])
            nearest = below[2]
            if abs(low - nearest) >= misfit * scale:
                nearest = below[np.abs(low - below).argmin()]
            stands[start:stop, k] = abs(low - nearest) < misfit * scale
            heights[start:stop, k] = nearest
            ends = below[:2] - nearest
            relief[start:stop, k] = np.where(np.abs(ends) < _EDGE * scale, ends, 0.0)
    return Footholds(stands, heights, relief)


def on_terrain(source: CanonicalMotion, terrain: Terrain) -> CanonicalMotion:
    """`source` on stated ground, its body as high over that as over its soles; notes say what was
    found. Raises `ConventionError` where the terrain is nowhere near.

    The floor is where feet stand beside the terrain: at z = 0 or at the terrain's base where that
    is near, as files have it. Where none does it is at z = 0, or below all of them.
    """
    rig, frame_time = source.rig, source.frame_time
    scale = rig.standing_height / ADULT_HEIGHT
    lowest, paths = sole_paths(source)
    lowest = lowest + source.floor_z
    _check_near(terrain, source, paths, scale)
    still = still_feet(paths, rig.standing_height, frame_time)
    nowhere = float(terrain.vertices[:, 2].min()) - _NOWHERE
    on = footholds(terrain, nowhere, paths, lowest, still, scale, _REACH)
    floor_z = _floor(terrain, lowest, still & ~on.stands, on, source.floor_z, scale)
    held, notes = footholds(terrain, floor_z, paths, lowest, still, scale, _REACH), []
    if not on.stands.any():
        notes.append(
            f"no foot of the source is seen to stand on the stated ground, {_size(terrain)} m large"
        )
    if not held.stands.any():
        return replace(source, terrain=terrain, floor_z=floor_z, notes=(*source.notes, *notes))
    over = np.where(held.stands, lowest - held.lowest, np.nan)
    off = float(np.nanmedian(over))
    if abs(off) > _OFF * scale:
        side = "above" if off > 0 else "below"
        notes.append(
            f"the source's feet stand {100 * abs(off):.0f} cm {side} the stated ground, in the "
            "median: is it measured in the source's world? They are put on it"
        )
    return replace(
        source,
        hips=source.hips - np.array([0.0, 0.0, 1.0]) * _drawn(over, frame_time)[:, None],
        floor_z=floor_z,
        terrain=terrain,
        notes=(*source.notes, *notes),
    )


def _drawn(over: Float[np.ndarray, "T S"], frame_time: float) -> Float[np.ndarray, "T"]:
    """How high [m] soles are drawn over the ground, as smooth as a body moves; NaN where none
    stands."""
    known = np.flatnonzero(np.isfinite(over).any(axis=1))
    means = np.nanmean(over[known], axis=1)
    every = np.interp(np.arange(len(over)), known, means)
    smooth: Float[np.ndarray, T] = gaussian_filter1d(every, _DRAWN / frame_time, mode="nearest")
    return smooth


def _floor(
    terrain: Terrain,
    lowest: Float[np.ndarray, "T S"],
    beside: Bool[np.ndarray, "T S"],
    held: Footholds,
    floor_z: float,
    scale: float,
) -> float:
    """The height of the floor [m, world]; feet that stand `beside` the terrain are on it."""
    base = float(terrain.vertices[:, 2].min())
    on = held.lowest[held.stands]
    if not len(on):
        seen = floor_z
    else:
        low = np.append(lowest[beside], np.inf)
        feet = low[low < on.min() + _REACH * scale]
        if not len(feet):
            return min(0.0, float(on.min()))
        seen = float(np.percentile(feet, 20))
    near = [z for z in (0.0, base) if abs(z - seen) < _BASE * scale]
    return min(near, key=lambda z: abs(z - seen), default=seen)


def _check_near(
    terrain: Terrain, source: CanonicalMotion, paths: Float[np.ndarray, "T S 2 3"], scale: float
) -> None:
    """Raise `ConventionError` where the terrain is far from wherever the source goes, or most of
    that is inside it."""
    low, high = terrain.vertices.min(axis=0), terrain.vertices.max(axis=0)
    places = paths.reshape(-1, 3) if paths.size else source.hips
    away = np.linalg.norm(np.maximum(np.maximum(low - places, places - high), 0.0), axis=1)
    inside = bool((terrain.way_up(source.hips) > 0.0).mean() > _INSIDE)
    if float(away.min()) < _NOWHERE * scale and not inside:
        return
    goes = " x ".join(f"{length:.3g}" for length in np.ptp(places, axis=0))
    where = "around" if inside else f"{away.min():.3g} m from the nearest step of"
    raise ConventionError(
        f"the stated ground, {_size(terrain)} m large, is {where} the "
        f"source, which goes over {goes} m: both are read in the unit and axes of the source's "
        f"file{_fitting(low, high, places)}"
    )


def _size(terrain: Terrain) -> str:
    return " x ".join(f"{length:.3g}" for length in np.ptp(terrain.vertices, axis=0))


def _fitting(
    low: Float[np.ndarray, "3"], high: Float[np.ndarray, "3"], places: Float[np.ndarray, "N 3"]
) -> str:
    """Which scale or axes of the terrain would put it where the source is, for a message."""
    middle = (places.min(axis=0) + places.max(axis=0)) / 2
    reach = np.ptp(places, axis=0).max() / 2 + 1.0
    for factor in (1.0, 0.001, 0.01, 0.0254, 0.3048, 100.0, 1000.0):
        for axes, words in (([0, 1, 2], ""), ([2, 0, 1], ", and Y up"), ([1, 2, 0], ", and X up")):
            a, b = factor * low[axes], factor * high[axes]
            size = float((b - a).max())
            if not 0.3 < size < 50 or (factor == 1.0 and not words):
                continue
            if (np.maximum(a - middle, middle - b) < reach).all():
                return f"; scaled by {factor:g}{words} it would be where the source is"
    return "; move it to where the source is"


def stated_under(
    source: CanonicalMotion, terrain: Terrain
) -> tuple[Float[np.ndarray, "T S 2"], Footholds]:
    """The ways of a source's feet [m, world], and what is under them, its heights [m] over the
    floor; in swing, between the two places by as much of its way as a foot has gone."""
    rig, scale = source.rig, source.rig.standing_height / ADULT_HEIGHT
    lowest, paths = sole_paths(source)
    ways = paths[..., :2].mean(axis=2)
    still = still_feet(paths, rig.standing_height, source.frame_time)
    held = footholds(terrain, source.floor_z, paths, lowest + source.floor_z, still, scale)
    told, heights, relief = held.stands.copy(), held.heights - source.floor_z, held.relief
    levels = np.unique(np.append(heights[told], 0.0))
    for k in range(heights.shape[1]):
        known = with_ends(told[:, k], heights[:, k], lowest[:, k], levels, SAME_HEIGHT * scale)
        both = np.column_stack([heights[:, k], relief[:, k]])
        both = between_contacts(both, known, ways[:, k])
        heights[:, k], relief[:, k] = both[:, 0], both[:, 1:]
    return ways, Footholds(held.stands, heights, relief)
