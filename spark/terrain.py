"""Stated ground: boxes, stairs, hills that a motion is on, as triangles."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from spark.summary import brief

# Of the terrain's size: vertices as near are one, and places are looked up so far from where they
# are, so that none lies on the edge between two triangles.
_SAME, _BESIDE = 1e-6, (1.3e-7, 0.7e-7)
_AT_ONCE = 1_000_000  # pairs of a triangle and a place


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
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components  # slow, and few motions state ground

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

    @cached_property
    def _extents(self) -> tuple[Float[np.ndarray, "F 2"], Float[np.ndarray, "F 2"]]:
        """From where to where each triangle is along X and Y."""
        return self.corners[..., :2].min(axis=1), self.corners[..., :2].max(axis=1)

    def crossings(self, places: Float[np.ndarray, "N 2"]) -> Crossings:
        """Where vertical lines through places go through triangles; upright ones have none."""
        size = float(np.ptp(self.vertices, axis=0).max(initial=0.0))
        x, y = places.T + size * np.array(_BESIDE)[:, None]
        found = [
            self._crossed(face, place, x[place], y[place])
            for face, place in boxed(x, y, *self._extents)
        ]
        if not found:
            return Crossings(np.zeros(0, dtype=int), np.zeros(0), np.zeros(0, dtype=int))
        return Crossings(*(np.concatenate(column) for column in zip(*found, strict=True)))

    def _crossed(
        self,
        face: Int[np.ndarray, "P"],
        place: Int[np.ndarray, "P"],
        x: Float[np.ndarray, "P"],
        y: Float[np.ndarray, "P"],
    ) -> Crossings:
        """Those of pairs of a triangle and a place at `x`, `y`."""
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = self.corners[face].transpose(1, 2, 0)
        area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
        area = np.where(area == 0.0, np.nan, area)
        dx, dy = x - ax, y - ay
        v = (dx * (cy - ay) - (cx - ax) * dy) / area
        w = ((bx - ax) * dy - dx * (by - ay)) / area
        inside = (v >= 0) & (w >= 0) & (v + w <= 1)
        z = az + v * (bz - az) + w * (cz - az)
        return Crossings(place[inside], z[inside], self.parts[face[inside]])

    def way_up(self, points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "N"]:
        """How far up [m] points are from where nothing is solid; 0 outside."""
        place, z, part = self.crossings(points[:, :2])
        order = np.lexsort((z, part, place))
        place, z, part = place[order], z[order], part[order]
        begins, ends = np.ones((2, len(z)), dtype=bool)
        begins[1:] = (np.diff(place) != 0) | (np.diff(part) != 0)
        ends[:-1] = begins[1:]
        first = np.maximum.accumulate(np.where(begins, np.arange(len(z)), 0))
        odd = (np.arange(len(z)) - first) % 2 == 1  # from the lowest crossing up, these are tops
        top = np.flatnonzero(np.where(self.closed[part], odd, ends))
        low = np.where(self.closed[part[top]], z[top - 1], -np.inf)
        high, place = z[top], place[top]
        out = points[:, 2].astype(np.float64)  # of a lower precision, no top would be reached
        while (inside := (low <= out[place]) & (out[place] < high)).any():
            np.maximum.at(out, place[inside], high[inside])
        up: Float[np.ndarray, N] = out - points[:, 2]
        return up

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


def boxed(
    x: Float[np.ndarray, "N"],
    y: Float[np.ndarray, "N"],
    low: Float[np.ndarray, "F 2"],
    high: Float[np.ndarray, "F 2"],
) -> Iterator[tuple[Int[np.ndarray, "P"], Int[np.ndarray, "P"]]]:
    """Pairs of a triangle and a place in the box around it, from `low` to `high`, some at once:
    places are sorted along Y in strips along X, and a triangle's are a run in each strip."""
    if not len(x):
        return
    start, end = np.array([x.min(), y.min()]), np.array([x.max(), y.max()])
    met = np.flatnonzero(((low <= end) & (high >= start)).all(axis=1))
    low, high = np.maximum(low[met], start) - start, np.minimum(high[met], end) - start
    wide, deep = end - start + 1e-9
    count = int(np.sqrt(len(x))) + 1
    strip = ((x - start[0]) / wide * count).astype(int)
    along = strip * deep + (y - start[1])
    order = along.argsort(kind="stable")
    first, last = ((bound[:, 0] / wide * count).astype(int) for bound in (low, high))
    row = np.repeat(np.arange(len(met)), last - first + 1)
    strips = deep * _runs(first, last - first + 1)
    begins = np.searchsorted(along[order], strips + low[row, 1], "left")
    counts = np.searchsorted(along[order], strips + high[row, 1], "right") - begins
    for own in np.split(np.arange(len(row)), _cuts(counts)):
        yield np.repeat(met[row[own]], counts[own]), order[_runs(begins[own], counts[own])]


def _cuts(counts: Int[np.ndarray, "R"]) -> Int[np.ndarray, "_"]:
    """Where to cut rows of so many pairs, that few of them are looked at at once."""
    return 1 + np.flatnonzero(np.diff(counts.cumsum() // _AT_ONCE))


def _runs(first: Int[np.ndarray, "R"], counts: Int[np.ndarray, "R"]) -> Int[np.ndarray, "_"]:
    """So many numbers from each first one on, one run after another."""
    before = counts.cumsum() - counts
    return np.repeat(first - before, counts) + np.arange(counts.sum())
