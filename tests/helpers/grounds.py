"""Stated ground that tests make: boxes, stairs in one piece, ramps, hills."""

from itertools import product

import numpy as np
from jaxtyping import Float

from spark.terrain import Terrain

_SIDES = (  # of the corners below, two triangles each, outward
    *((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)),
)


def box(low: tuple[float, float, float], high: tuple[float, float, float]) -> Terrain:
    """A box between two corners [m]."""
    corners = np.array(list(product(*zip(low, high, strict=True))), dtype=float)
    faces = [tri for a, b, c, d in _SIDES for tri in ((a, b, c), (a, c, d))]
    return Terrain(corners, np.array(faces))


def together(*grounds: Terrain) -> Terrain:
    """Several as one."""
    starts = np.cumsum([0, *(len(each.vertices) for each in grounds)])
    faces = [each.faces + start for each, start in zip(grounds, starts[:-1], strict=True)]
    return Terrain(np.concatenate([each.vertices for each in grounds]), np.concatenate(faces))


def profile(outline: Float[np.ndarray, "N 2"], width: float) -> Terrain:
    """An open surface that is as high [m] along X as a line of places and heights says."""
    count = len(outline)
    sides = [np.insert(outline, 1, y, axis=1) for y in (-width / 2, width / 2)]
    first = np.arange(count - 1)
    quads = np.stack([first, first + 1, first + 1 + count, first + count], axis=1)
    return Terrain(
        np.concatenate(sides), np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    )


def stairs(steps: int, rise: float, tread: float, start: float) -> Terrain:
    """A flight up along X, in one piece; its first riser is at `start` [m]."""
    rows = [(start, 0.0)]
    for k in range(steps):
        rows += [(start + k * tread, (k + 1) * rise), (start + (k + 1) * tread, (k + 1) * rise)]
    rows.append((start + steps * tread, 0.0))
    return profile(np.array(rows), 2.0)


def hill(height: float, radius: float, spacing: float) -> Terrain:
    """An open surface: a bell so high [m] around the origin."""
    ticks = np.arange(-4 * radius, 4 * radius + spacing / 2, spacing)
    x, y = np.meshgrid(ticks, ticks, indexing="ij")
    z = height * np.exp(-(x**2 + y**2) / (2 * radius**2))
    number = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (
        each.ravel()
        for each in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    )
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Terrain(np.stack([x, y, z], axis=-1).reshape(-1, 3), faces)
