"""Points on the surface of a MuJoCo geom, in the geom's own axes."""

from collections.abc import Sequence
from itertools import product

import mujoco
import numpy as np
from jaxtyping import Float
from scipy.spatial import ConvexHull, QhullError

from sim.body.geoms import HIDDEN_GROUP

_SPHERE, _CAPSULE, _ELLIPSOID, _CYLINDER, _BOX, _MESH = (
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}"))
    for kind in ("SPHERE", "CAPSULE", "ELLIPSOID", "CYLINDER", "BOX", "MESH")
)


def fibonacci_sphere(count: int) -> Float[np.ndarray, "N 3"]:
    """Evenly spread unit directions: a Fibonacci lattice (Gonzalez 2010)."""
    k = np.arange(count) + 0.5
    z, angle = 1 - 2 * k / count, np.pi * (1 + np.sqrt(5)) * k
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)


_LOOKS, _RING = fibonacci_sphere(200), 32  # of `surface`, on what is round


def solid(model: mujoco.MjModel, geoms: Sequence[int]) -> list[int]:
    """Those of some geoms that collide. Of a part where none does, as of a body that a model lets
    touch the floor with its feet alone: those that are hidden, or else all."""
    parts: dict[int, list[int]] = {}
    for g in geoms:
        parts.setdefault(int(model.body_weldid[model.geom_bodyid[g]]), []).append(g)
    found = set()
    for own in parts.values():
        colliding = [g for g in own if model.geom_contype[g] or model.geom_conaffinity[g]]
        hidden = [g for g in own if model.geom_group[g] >= HIDDEN_GROUP]
        found.update(colliding or hidden or own)
    return [g for g in geoms if g in found]


def outline(
    model: mujoco.MjModel,
    geom: int,
    *,
    ellipsoid: Float[np.ndarray, "D 3"],
    mesh: Float[np.ndarray, "E 3"],
    ring: int,
) -> tuple[Float[np.ndarray, "P 3"], float]:
    """Points [m] and the radius [m] of the ball around each of them that together span the geom.

    Spheres, capsules and boxes are exact. An ellipsoid has a point for each of the unit directions
    `ellipsoid`, a mesh the vertex that is furthest along each of the directions `mesh`, a cylinder
    `ring` points on either edge. A plane and a height field have none.
    """
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind == _SPHERE:
        return np.zeros((1, 3)), float(size[0])
    if kind == _CAPSULE:
        return np.array([[0, 0, size[1]], [0, 0, -size[1]]]), float(size[0])
    if kind == _ELLIPSOID:
        scaled = ellipsoid * size
        return scaled * size / np.linalg.norm(scaled, axis=1, keepdims=True), 0.0
    if kind == _CYLINDER:
        angle = 2 * np.pi * np.arange(ring) / ring
        edge = np.stack([size[0] * np.cos(angle), size[0] * np.sin(angle)], axis=1)
        return np.concatenate([np.insert(edge, 2, z, axis=1) for z in (-size[1], size[1])]), 0.0
    if kind == _BOX:
        return np.array(list(product((-1.0, 1.0), repeat=3))) * size, 0.0
    if kind == _MESH:
        k = int(model.geom_dataid[geom])
        start, count = int(model.mesh_vertadr[k]), int(model.mesh_vertnum[k])
        vertices = model.mesh_vert[start : start + count].astype(np.float64)
        return vertices[np.unique((vertices @ mesh.T).argmax(axis=0))], 0.0
    return np.zeros((0, 3)), 0.0


def all_around(
    model: mujoco.MjModel, geom: int, looks: Float[np.ndarray, "D 3"], ring: int
) -> Float[np.ndarray, "P 3"]:
    """The points of `outline` [m], and where it has a radius, those on the balls around them: what
    is round is looked at from `looks`."""
    points, radius = outline(model, geom, ellipsoid=looks, mesh=looks, ring=ring)
    return (points[:, None] + radius * looks).reshape(-1, 3) if radius else points


def surface(model: mujoco.MjModel, geom: int, spacing: float) -> Float[np.ndarray, "P 3"]:
    """Points [m] all over a geom's convex hull, at most about `spacing` [m] from each other; of a
    round one to within a millimetre or two. A plane and a height field have none."""
    points = all_around(model, geom, _LOOKS, _RING)
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):  # it is flat, or has no points
        return points
    found = [hull.points[hull.vertices]]
    for corners in hull.points[hull.simplices]:
        longest = float(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).max())
        count = max(int(np.ceil(longest / spacing)), 1)
        u, v = np.indices((count + 1, count + 1)).reshape(2, -1) / count
        inside = u + v < 1 + 1e-9
        shares = np.stack([u, v, 1 - u - v], axis=1)[inside]
        found.append(shares @ corners)
    every = np.concatenate(found)
    kept = np.unique((every / (spacing / 2)).round(), axis=0, return_index=True)[1]
    return every[kept]
