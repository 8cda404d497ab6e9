"""The ground under a motion: a level floor, and what is above it, stated or told from its feet."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from jaxtyping import Float

from spark.terrain import Terrain
from spark.transfer.distance_field import DistanceField, distance_field

# Hip heights around a place to which what a foot stands on there reaches, for feet, and for hands
# and knees: things end somewhere, and feet swing by.
FOOT_REACH, REACH = 0.3, 0.5
_BELOW = 0.01  # hip heights below its top at which a point is still on it, and not beside it
_SAME_PLACE, _SAME_HEIGHT = 0.2, 0.02  # hip heights: places that are one
_SPACING = 0.02  # [m] between the nodes that say how deep points are in stated ground
_UNDER = 0.15  # [m] that a point may be in it, of a body whose parts are where they are drawn


@dataclass(frozen=True)
class Stand:
    """That a foot stands at height `z` [m, world] in the frames from `start` up to `stop`."""

    foot: str
    start: int
    stop: int
    z: float


@dataclass(frozen=True, eq=False)
class Ground:
    """The floor at `floor_z` [m, world], and what is above it: `tops` [m], around each of which it
    reaches as far as for a body with hips at `hip_height` [m], and when feet stand there.

    A floor that slopes is `gradient` [m] higher a metre further along X and Y, and at `floor_z` at
    the place `middle` [m]. A `terrain` [m, world] is stated, and then nothing else is above it;
    `around` is the distance from it, where that is known already.
    """

    floor_z: float
    tops: Float[np.ndarray, "K 3"]
    stands: tuple[Stand, ...] = ()
    hip_height: float = 0.0
    gradient: tuple[float, float] = (0.0, 0.0)
    middle: tuple[float, float] = (0.0, 0.0)
    terrain: Terrain | None = None
    around: DistanceField | None = None

    def picked(self, span: slice) -> "Ground":
        """In the frames of a slice."""
        shifted = [
            replace(each, start=max(each.start - span.start, 0), stop=each.stop - span.start)
            for each in self.stands
        ]
        return replace(self, stands=tuple(each for each in shifted if each.stop > 0))

    def with_tops(self, tops: Sequence[Sequence[float]], hip_height: float) -> "Ground":
        """With more of them [m, world], for a body of that size."""
        if not len(tops):
            return self
        known = distinct(np.concatenate([self.tops, np.array(tops)]), hip_height)
        return replace(self, tops=known, hip_height=hip_height)

    def heights(
        self, points: Float[np.ndarray, "T P 3"], feet: Sequence[str] = ()
    ) -> Float[np.ndarray, "T P"]:
        """How high [m] points are over the ground below them; the first ones, corners of `feet`,
        over what these stand on while they do."""
        out = points[..., 2] - self.floor_z
        if any(self.gradient):
            out = out - (points[..., :2] - np.array(self.middle)) @ np.array(self.gradient)
        if self.terrain is not None and points.size:
            out = np.minimum(out, points[..., 2] - self.terrain.tops(points, 0.0))
            depth = self.depth(points)
            return np.where(depth > 0.0, -depth, out)
        if not len(self.tops) or not points.size:
            return out
        across = points[..., :2].reshape(-1, 2)
        away = np.maximum(across.min(0) - self.tops[:, :2], self.tops[:, :2] - across.max(0))
        reach = np.full(points.shape[1], REACH * self.hip_height)
        reach[: len(feet)] = FOOT_REACH * self.hip_height
        for top in self.tops[away.max(axis=1) < REACH * self.hip_height]:
            away = points - top
            on = np.linalg.norm(away[..., :2], axis=-1) < reach
            on &= away[..., 2] > -_BELOW * self.hip_height
            out = np.where(on, np.minimum(out, away[..., 2]), out)
        for each in self.stands:
            own = [k for k, foot in enumerate(feet) if foot == each.foot]
            out[each.start : each.stop, own] = points[each.start : each.stop, own, 2] - each.z
        return out

    def under(self, points: Float[np.ndarray, "T P 3"]) -> Float[np.ndarray, "T P"]:
        """How high [m] over the floor the ground below points is, or around them."""
        if self.terrain is not None:
            return np.maximum(self.terrain.tops(points, _UNDER) - self.floor_z, 0.0)
        return points[..., 2] - self.floor_z - self.heights(points)

    def depth(self, points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n"]:
        """How deep [m] points are in what is stated; 0 outside. Of the way out that a grid knows
        and the way straight up it is the shorter."""
        out, away = np.zeros(points.shape[:-1]), self.distance(points)
        near = away < 0.0
        if self.terrain is not None and near.any():
            out[near] = np.minimum(-away[near], self.terrain.way_up(points[near]))
        return out

    def distance(self, points: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n"]:
        """How far [m] points are from what is stated, as a grid knows it; below 0 inside, and inf
        where nothing is."""
        if self.terrain is None:
            return np.full(points.shape[:-1], np.inf)
        field = _field(self.terrain) if self.around is None else self.around
        return field.distance(np.moveaxis(points, -1, 0))


@lru_cache(maxsize=4)
def _field(terrain: Terrain) -> DistanceField:
    """How far points are from a terrain."""
    low, high = (bound(terrain.vertices, axis=0) for bound in (np.min, np.max))
    return distance_field(terrain, low - 1.0, high + 1.0, _SPACING)


def level_ground(floor_z: float) -> Ground:
    """A floor and nothing else."""
    return Ground(floor_z, np.zeros((0, 3)))


def distinct(tops: Float[np.ndarray, "N 3"], hip_height: float) -> Float[np.ndarray, "K 3"]:
    """Places [m] without those that are about where an earlier one is."""
    kept = np.zeros((0, 3))
    for top in tops:
        away = kept - top
        near = np.linalg.norm(away[:, :2], axis=1) < _SAME_PLACE * hip_height
        if not (near & (np.abs(away[:, 2]) < _SAME_HEIGHT * hip_height)).any():
            kept = np.vstack([kept, top])
    return kept
