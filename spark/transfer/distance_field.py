"""How far points are from stated ground: a signed distance on a grid, exact near the surface."""

from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import binary_dilation, distance_transform_edt

from spark.summary import brief
from spark.terrain import Terrain
from spark.vectors import dot

_BAND = 1.8  # spacings: nodes beside the surface are within so many of it, along a diagonal, too
_SEAM = 0.4  # spacings: by no more are points of the surface beside each other apart
_MARGIN = 6  # spacings around the terrain that are on the grid
_MOST = 8_000_000  # nodes: of larger grounds they lie farther apart
_AT_ONCE = 500_000  # nodes
_FAR = 1e3  # [m] outside of the grid


class Away(NamedTuple):
    """How far [m] points are from what is solid, below 0 inside, and the unit vectors there."""

    distance: Float[np.ndarray, "*n"]
    out: Float[np.ndarray, "3 *n"]


@dataclass(frozen=True, eq=False)
class DistanceField:
    """Signed distances [m] from what is solid of a `terrain`, at nodes that lie `spacing` [m] apart
    from `low` [m, world] on. Between nodes they are trilinear: exact along a plane, and rounded at
    edges."""

    terrain: Terrain
    low: Float[np.ndarray, "3"]
    spacing: float
    values: Float[np.ndarray, "X Y Z"]

    __repr__ = brief

    def placed(self, scale: float, shift: Float[np.ndarray, "3"]) -> "DistanceField":
        """That of the terrain shifted [m], and then scaled about the origin."""
        terrain, low = self.terrain.placed(scale, shift), scale * (self.low + shift)
        return DistanceField(terrain, low, scale * self.spacing, scale * self.values)

    def distance(self, points: Float[np.ndarray, "3 *n"]) -> Float[np.ndarray, "*n"]:
        """Of points [m, world]; far outside of the grid."""
        return self.away(points).distance

    def away(self, points: Float[np.ndarray, "3 *n"]) -> Away:
        """The same, with the way out."""
        at = (points.reshape(3, -1) - self.low[:, None]) / self.spacing
        most = np.array(self.values.shape)[:, None] - 1.0
        known = np.flatnonzero(((at >= 0) & (at < most)).all(axis=0))
        distance, out = np.full(at.shape[1], _FAR), np.zeros_like(at)
        if len(known):
            distance[known], out[:, known] = self._between(at[:, known])
        return Away(distance.reshape(points.shape[1:]), out.reshape(points.shape))

    def _between(
        self, at: Float[np.ndarray, "3 N"]
    ) -> tuple[Float[np.ndarray, "N"], Float[np.ndarray, "3 N"]]:
        node = at.astype(np.int64)
        u, v, w = at - node
        _, ny, nz = self.values.shape
        first, flat = (node[0] * ny + node[1]) * nz + node[2], self.values.reshape(-1)
        c = [[[flat[first + (i * ny + j) * nz + k].astype(np.float64) for k in (0, 1)]
              for j in (0, 1)] for i in (0, 1)]  # fmt: skip
        along_z = [[each[0] + w * (each[1] - each[0]) for each in row] for row in c]
        along_y = [row[0] + v * (row[1] - row[0]) for row in along_z]
        slope_x = along_y[1] - along_y[0]
        slope_y, slope_z = (
            one + u * (other - one)
            for one, other in (
                [row[1] - row[0] for row in along_z],
                [
                    (row[0][1] - row[0][0])
                    + v * ((row[1][1] - row[1][0]) - (row[0][1] - row[0][0]))
                    for row in c
                ],
            )
        )
        slopes = np.stack([slope_x, slope_y, slope_z])
        return along_y[0] + u * slope_x, slopes / np.maximum(np.linalg.norm(slopes, axis=0), 1e-9)


def distance_field(
    terrain: Terrain, low: Float[np.ndarray, "3"], high: Float[np.ndarray, "3"], spacing: float
) -> DistanceField:
    """That around a terrain, as far as it is between two corners [m, world].

    Nodes beside the surface are as far as the nearest triangle is. Others are as far as the nearest
    point of the surface is that the nearest of those nodes has (a vector distance transform:
    Danielsson 1980). Triangles in the solid, where parts are in each other, are no surface.
    """
    reach = _MARGIN * spacing
    low = np.maximum(low, terrain.vertices.min(axis=0) - reach)
    high = np.maximum(np.minimum(high, terrain.vertices.max(axis=0) + reach), low)
    spacing = max(spacing, float((np.prod(high - low + spacing) / _MOST) ** (1 / 3)))
    axes = [
        start + spacing * np.arange(int((stop - start) / spacing) + 2)
        for start, stop in zip(low, high, strict=True)
    ]
    inside = _solid(terrain, axes)
    distance, nearest = _beside(terrain, axes, _BAND * spacing)
    surface = np.isfinite(distance) & (~inside | binary_dilation(~inside))
    _pass_over_seams(axes, inside, surface, distance, nearest)
    values = np.full(inside.shape, _FAR)
    if surface.any():
        where = distance_transform_edt(~surface, return_distances=False, return_indices=True)
        nodes = np.stack(np.meshgrid(*axes, indexing="ij"))
        found = nearest[(slice(None), *where)]
        values = np.where(surface, distance, np.linalg.norm(nodes - found, axis=0))
        values[inside] *= -1.0
    return DistanceField(terrain, low, spacing, values)


def _pass_over_seams(
    axes: list[Float[np.ndarray, "N"]],
    inside: Bool[np.ndarray, "X Y Z"],
    surface: Bool[np.ndarray, "X Y Z"],
    distance: Float[np.ndarray, "X Y Z"],
    nearest: Float[np.ndarray, "3 X Y Z"],
) -> None:
    """The nearest triangle of a node inside may be where two parts meet, and no surface. That of a
    node outside is: where those beside it have theirs much farther away, it is as far as that."""
    nodes = np.argwhere(surface & inside)
    places = np.stack([axis[at] for axis, at in zip(axes, nodes.T, strict=True)])
    least, found = np.full(len(nodes), np.inf), np.zeros_like(places)
    for shift in product((-1, 0, 1), repeat=3):
        beside = tuple(np.clip(nodes + shift, 0, np.array(inside.shape) - 1).T)
        points = nearest[(slice(None), *beside)]
        away = np.linalg.norm(places - points, axis=0)
        nearer = ~inside[beside] & np.isfinite(distance[beside]) & (away < least)
        least[nearer], found[:, nearer] = away[nearer], points[:, nearer]
    known = np.isfinite(least)
    own, spacing = tuple(nodes[known].T), axes[0][1] - axes[0][0]
    seam = least[known] - distance[own] > _SEAM * spacing
    distance[own] = np.where(seam, least[known], distance[own])
    nearest[(slice(None), *own)] = found[:, known]  # for those that are deeper


def _solid(terrain: Terrain, axes: list[Float[np.ndarray, "N"]]) -> Bool[np.ndarray, "X Y Z"]:
    """Which nodes are in some part."""
    x, y, z = axes
    places = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    found = terrain.crossings(places)
    inside = np.zeros((len(places), len(z)), dtype=bool)
    below = np.searchsorted(z, found.z)  # nodes of the column that the crossing is above
    for part in np.unique(found.part).tolist():
        own = found.part == part
        columns, number = np.unique(found.place[own], return_inverse=True)
        over = np.zeros((len(columns), len(z) + 1), dtype=np.int32)
        np.add.at(over, (number, below[own]), 1)
        above = over[:, ::-1].cumsum(axis=1)[:, ::-1][:, 1:]
        inside[columns] |= above % 2 == 1 if terrain.closed[part] else above > 0
    return inside.reshape(len(x), len(y), len(z))


def _beside(
    terrain: Terrain, axes: list[Float[np.ndarray, "N"]], band: float
) -> tuple[Float[np.ndarray, "X Y Z"], Float[np.ndarray, "3 X Y Z"]]:
    """How far [m] nodes are from the nearest triangle, and its point there; inf beyond the band."""
    shape, start = np.array([len(axis) for axis in axes]), np.array([axis[0] for axis in axes])
    spacing, corners = axes[0][1] - axes[0][0], terrain.corners
    low, high, middles = corners.min(axis=1), corners.max(axis=1), corners.mean(axis=1)
    first = np.ceil((low - band - start) / spacing).astype(int)
    last = np.floor((high + band - start) / spacing).astype(int)
    first, last = np.maximum(first, 0), np.minimum(last, shape - 1)
    met = np.flatnonzero((first <= last).all(axis=1))
    sizes = last[met] - first[met] + 1
    order = np.lexsort((*sizes.T, sizes.prod(axis=1)))  # alike ones are looked at together
    met, sizes = met[order], sizes[order]
    distance, nearest = np.full(shape.prod(), np.inf), np.zeros((shape.prod(), 3))
    most_away = np.full(shape.prod(), band)  # as the middles of triangles say: most are farther
    begin = 0
    while begin < len(met):
        most = np.maximum.accumulate(sizes[begin : begin + _AT_ONCE], axis=0).prod(axis=1)
        end = begin + max(1, int((most * (1 + np.arange(len(most))) <= _AT_ONCE).sum()))
        size, own = sizes[begin:end].max(axis=0), met[begin:end]
        nodes = first[own, None] + np.indices(size).reshape(3, -1).T
        which, at = np.nonzero((nodes <= last[own, None]).all(axis=2))
        nodes, which = nodes[which, at], own[which]
        flat, places = np.ravel_multi_index(nodes.T, shape), start + spacing * nodes
        np.minimum.at(most_away, flat, _length(places - middles[which]))
        outside = np.maximum(low[which] - places, places - high[which]).clip(0.0)
        kept = _length(outside) <= most_away[flat]
        flat, places = flat[kept], places[kept]
        points = on_triangles(places, corners[which[kept]])
        away = _length(places - points)
        nearer = np.flatnonzero(away < np.minimum(distance[flat], band))
        nearer = nearer[away[nearer].argsort()[::-1]]  # of one node the nearest is written last
        distance[flat[nearer]], nearest[flat[nearer]] = away[nearer], points[nearer]
        begin = end
    return distance.reshape(shape), nearest.T.reshape(3, *shape)


def _length(vectors: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N"]:
    return np.sqrt(np.einsum("ni,ni->n", vectors, vectors))


def on_triangles(
    points: Float[np.ndarray, "N 3"], corners: Float[np.ndarray, "N 3 3"]
) -> Float[np.ndarray, "N 3"]:
    """The nearest point of a triangle to each point: in its plane where that is above or below it,
    else on the nearest of its edges."""
    edges = np.roll(corners, -1, axis=1) - corners
    normal = np.cross(edges[:, 0], edges[:, 1])
    least, over = np.full(len(points), np.inf), np.ones(len(points), dtype=bool)
    out = np.empty_like(points)
    for k in range(3):
        edge, away = edges[:, k], points - corners[:, k]
        share = dot(edge, away) / np.maximum(dot(edge, edge), 1e-30)
        beside = away - edge * np.clip(share, 0.0, 1.0)
        squared = dot(beside, beside)[:, 0]
        nearer = squared < least
        least, out[nearer] = np.minimum(least, squared), (points - beside)[nearer]
        over &= dot(np.cross(normal, edge), away)[:, 0] >= 0
    squared_area = dot(normal, normal)
    over &= squared_area[:, 0] > 1e-30
    height = dot(normal, points - corners[:, 0]) / np.maximum(squared_area, 1e-30)
    out[over] = (points - normal * height)[over]
    return out
