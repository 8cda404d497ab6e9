"""Balls that fill the convex hull of a mesh: a rod or a plate of them would bulge out of it by
centimetres where it is slanted, and arms be kept off by as much."""

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float
from scipy.spatial import ConvexHull, QhullError

from sim.outline import fibonacci_sphere

_LOOKS = fibonacci_sphere(100)  # ways along which the outermost vertices are looked for
_SPACING = 0.02  # [m] between places of balls that are tried,
_MOST = np.array([6, 8, 14])  # and how many of these there are along a hull's axes, at most
_POINTS = 250  # of its surface that the balls are to cover,
_NEAR, _NEAR_SHARE = 0.012, 0.2  # [m] up to this, or of the hull's thickness
_BULGE_SHARE = 0.5  # of that, by which a ball may bulge out of the hull
_LEAST_RADIUS = 0.005  # [m]
_MAX_BALLS = 24


@dataclass(frozen=True, eq=False)
class Hull:
    """The convex hull of a mesh: its outermost points [m], the triangles between them, and planes
    that touch it all around: unit normals, and how far [m] along them it reaches."""

    outer: Float[np.ndarray, "V 3"]
    triangles: Float[np.ndarray, "F 3 3"]
    planes: Float[np.ndarray, "E 4"]


def hull_of(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> Hull | None:
    """That of a mesh where `data` places it; None for other geoms, and for what is flat."""
    if int(model.geom_type[geom]) != int(mujoco.mjtGeom.mjGEOM_MESH):
        return None
    vertices = _hull_vertices(model, int(model.geom_dataid[geom]))
    return hull_around(vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])


def hull_around(placed: Float[np.ndarray, "V 3"]) -> Hull | None:
    """That of some points [m]; None where it is flat."""
    outer = placed[np.unique((placed @ _LOOKS.T).argmax(axis=0))]
    try:
        found = ConvexHull(outer)
    except (QhullError, ValueError):
        return None
    normals = np.unique(found.equations[:, :3].round(6), axis=0)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    reach = (placed @ normals.T).max(axis=0)
    return Hull(outer, outer[found.simplices], np.column_stack([normals, reach]))


def balls_in(
    hull: Hull, most_near: float = _NEAR, most: int = _MAX_BALLS
) -> tuple[Float[np.ndarray, "S 3"], Float[np.ndarray, "S"]]:
    """Centres and radii [m] of balls that cover the hull's surface but for `most_near`, as far as
    so many go, and bulge out of it by half of that at most: of those on a grid the one that covers
    most, again and again."""
    centres = _grid(hull)
    depth = (hull.planes[:, 3] - centres @ hull.planes[:, :3].T).min(axis=1)
    near = min(most_near, 2 * _NEAR_SHARE * float(depth.max(initial=0.0)))
    radii = depth + _BULGE_SHARE * near
    fit = radii > _LEAST_RADIUS
    centres, radii = centres[fit], radii[fit]
    away = np.linalg.norm(_surface(hull)[:, None] - centres, axis=2) - radii
    covers = away < near
    chosen: list[int] = []
    while len(chosen) < most and covers.any():
        chosen.append(int(covers.sum(axis=0).argmax()))
        covers = covers[~covers[:, chosen[-1]]]
    return centres[chosen], radii[chosen]


def _hull_vertices(model: mujoco.MjModel, mesh: int) -> Float[np.ndarray, "V 3"]:
    """A mesh's vertices, in its own axes: those of the hull alone where MuJoCo knows them."""
    start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = model.mesh_vert[start : start + count].astype(np.float64)
    graph = int(model.mesh_graphadr[mesh])
    if graph < 0:
        return vertices
    # The numbers of vertices and faces, an address for each vertex, and its number in the mesh.
    known = int(model.mesh_graph[graph])
    return vertices[model.mesh_graph[graph + 2 + known : graph + 2 + 2 * known]]


def _grid(hull: Hull) -> Float[np.ndarray, "N 3"]:
    middle = hull.outer.mean(axis=0)
    axes = np.linalg.eigh(np.cov((hull.outer - middle).T))[1]
    inside = (hull.outer - middle) @ axes
    low, high = inside.min(axis=0), inside.max(axis=0)
    counts = np.clip(np.ceil((high - low) / _SPACING), 3, _MOST).astype(int)
    places = [
        a + (np.arange(n) + 0.5) * (b - a) / n for a, b, n in zip(low, high, counts, strict=True)
    ]
    grid = np.stack(np.meshgrid(*places, indexing="ij"), axis=-1).reshape(-1, 3)
    return middle + grid @ axes.T


def _surface(hull: Hull) -> Float[np.ndarray, "P 3"]:
    """Its corners, and points spread over it at random, the same ones each time."""
    a, b, c = hull.triangles.transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    rng = np.random.default_rng(0)
    at = rng.choice(len(area), _POINTS, p=area / area.sum())
    u, v = np.sort(rng.random((2, _POINTS, 1)), axis=0)
    return np.concatenate([hull.outer, a[at] + u * (b - a)[at] + (v - u) * (c - a)[at]])
