"""Stated ground: boxes, stairs, hills that a motion is on, as triangles."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from spark.summary import brief

# Of the terrain's size: vertices as near are one, and places are looked up so far from where they
# are, so that none lies on the edge between two triangles.
_SAME, _BESIDE = 1e-6, (1.3e-7, 0.7e-7)


class Crossings(NamedTuple):
    """Where vertical lines through some places go through triangles: the number of the place, the
    height `z` [m], and the number of the part."""

    place: Int[np.ndarray, "C"]
    z: Float[np.ndarray, "C"]
    part: Int[np.ndarray, "C"]


@dataclass(frozen=True, eq=False)
class Terrain:
    """Triangles [m, world, Z up]. What hangs together is a part; each is solid inside where its
    surface is closed, and below it where that is open. They may lie in each other."""

    vertices: Float[np.ndarray, "V 3"]
    faces: Int[np.ndarray, "F 3"]

    __repr__ = brief

    def placed(self, scale: float, shift: Float[np.ndarray, "3"]) -> "Terrain":
        """Shifted [m], and then scaled about the origin."""
        return Terrain(scale * (self.vertices + shift), self.faces)

    @cached_property
    def corners(self) -> Float[np.ndarray, "F 3 3"]:
        """Those of each triangle."""
        return self.vertices[self.faces]

    @cached_property
    def parts(self) -> Int[np.ndarray, "F"]:
        """The number of the part of each triangle."""
        return self._parts[0]

    @cached_property
    def closed(self) -> Bool[np.ndarray, "K"]:
        """Of each part whether its surface is: each edge is two triangles' (or four's)."""
        return self._parts[1]

    @cached_property
    def _parts(self) -> tuple[Int[np.ndarray, "F"], Bool[np.ndarray, "K"]]:
        size = max(float(np.ptp(self.vertices, axis=0).max(initial=0.0)), 1e-9)
        grid = np.round(self.vertices / (_SAME * size))
        same = np.unique(grid, axis=0, return_inverse=True)[1].reshape(-1)[self.faces]
        edges = np.sort(np.concatenate([same[:, [0, 1]], same[:, [1, 2]], same[:, [2, 0]]]), axis=1)
        graph = coo_array((np.ones(len(edges)), tuple(edges.T)), shape=(same.max() + 1,) * 2)
        of_vertices = connected_components(graph, directed=False)[1]
        parts = np.unique(of_vertices[same[:, 0]], return_inverse=True)[1].reshape(-1)
        known, edge, counts = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
        odd = (counts % 2 == 1) & (known[:, 0] != known[:, 1])
        closed = np.ones(parts.max() + 1, dtype=bool)
        closed[np.tile(parts, 3)[odd[edge.reshape(-1)]]] = False
        return parts, closed

    def crossings(self, places: Float[np.ndarray, "N 2"]) -> Crossings:
        """Where vertical lines through places go through triangles; upright ones have none."""
        order = places[:, 0].argsort(kind="stable")
        size = float(np.ptp(self.vertices, axis=0).max(initial=0.0))
        x, y = places[order].T + size * np.array(_BESIDE)[:, None]
        corners = self.corners
        low, high = corners.min(axis=1), corners.max(axis=1)
        first, last = np.searchsorted(x, low[:, 0]), np.searchsorted(x, high[:, 0])
        met = first < last
        if len(places):
            met &= (high[:, 1] > y.min()) & (low[:, 1] < y.max())
        found = []
        for f in np.flatnonzero(met).tolist():
            (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners[f].tolist()
            area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
            if area == 0.0:
                continue
            own = slice(first[f], last[f])
            dx, dy = x[own] - ax, y[own] - ay
            v = (dx * (cy - ay) - (cx - ax) * dy) / area
            w = ((bx - ax) * dy - dx * (by - ay)) / area
            inside = np.flatnonzero((v >= 0) & (w >= 0) & (v + w <= 1))
            if len(inside):
                z = az + v[inside] * (bz - az) + w[inside] * (cz - az)
                found.append((order[first[f] + inside], z, np.full(len(inside), self.parts[f])))
        if not found:
            return Crossings(np.zeros(0, dtype=int), np.zeros(0), np.zeros(0, dtype=int))
        return Crossings(*(np.concatenate(column) for column in zip(*found, strict=True)))

    def tops(
        self, points: Float[np.ndarray, "*n 3"], above: float | Float[np.ndarray, "*n"]
    ) -> Float[np.ndarray, "*n"]:
        """How high [m] the highest top is that is at most so far `above` [m] each point; -inf where
        there is none."""
        flat = points.reshape(-1, 3)
        limit = flat[:, 2] + np.broadcast_to(above, points.shape[:-1]).reshape(-1)
        place, z, part = self.crossings(flat[:, :2])
        order = np.lexsort((-z, part, place))
        place, z, part = place[order], z[order], part[order]
        begins = np.ones(len(z), dtype=bool)
        begins[1:] = (np.diff(place) != 0) | (np.diff(part) != 0)
        first = np.maximum.accumulate(np.where(begins, np.arange(len(z)), 0))
        count = np.arange(len(z)) - first  # from the highest crossing down: every second is a top
        is_top = np.where(self.closed[part], count % 2 == 0, count == 0)
        kept = is_top & (z <= limit[place])
        out = np.full(len(flat), -np.inf)
        np.maximum.at(out, place[kept], z[kept])
        return out.reshape(points.shape[:-1])
