"""Where a robot's parts end: points on the surface of its shapes, in the rest pose's world."""

from collections.abc import Iterable
from itertools import product

import mujoco
import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import ConvexHull, QhullError

from robots.model.mjcf import Mjcf
from sim.outline import all_around, solid
from spark.rotation import quat_between

_NEAR_LOWEST = 0.08  # of the foot's length: points this low belong to the sole
TILTED, _COPLANAR = np.radians(40), np.radians(3)
_LONG = 0.7  # a sole's width as a share of its length, up to which its length is known
_RING = 12  # points on either edge of a cylinder

# 26 unit vectors towards the faces, edges and corners of a cube.
DIRECTIONS = np.array([d for d in product((-1.0, 0.0, 1.0), repeat=3) if any(d)])
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)


def surface(mjcf: Mjcf, bodies: Iterable[int]) -> Float[np.ndarray, "P 3"]:
    """Points on the solid shapes of some bodies."""
    model = mjcf.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    geoms = np.flatnonzero(np.isin(model.geom_bodyid, list(bodies))).tolist()
    points = [np.zeros((0, 3))]
    points.extend(surface_of(model, data, geom) for geom in solid(model, geoms))
    return np.concatenate(points)


def surface_of(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> Float[np.ndarray, "P 3"]:
    """Points on one shape, where `data` places it; none for what has no surface of its own."""
    points = all_around(model, geom, DIRECTIONS, _RING)
    rotation = data.geom_xmat[geom].reshape(3, 3)
    return points @ rotation.T + data.geom_xpos[geom]


def corners(points: Float[np.ndarray, "P 3"]) -> list[int]:
    """Which points are the corners of a sole that stands on the floor, facing +X: heel right and
    left, toe right and left."""
    low = _lowest(points)
    middle = (points[low].max(0) + points[low].min(0)) / 2
    size = np.maximum(np.ptp(points[low], axis=0), 1e-9)
    inside = (points[low] - middle)[:, :2] / size[:2]
    return [int(low[np.argmax(inside @ np.array(way))]) for way in product((-1.0, 1.0), repeat=2)]


def flattening(points: Float[np.ndarray, "P 3"]) -> tuple[Float[np.ndarray, "4"], float] | None:
    """The smallest rotation that lays the largest flat side below a foot on the floor, and that
    side's area [m²]; None where no side within `TILTED` of the floor stands out, as on a ball."""
    try:
        hull = ConvexHull(points)
    except (QhullError, ValueError):  # fewer than four points, or all in a plane
        return None
    normals = hull.equations[:, :3]
    sides = points[hull.simplices]
    areas = (
        np.linalg.norm(np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0]), axis=1) / 2
    )
    below = np.flatnonzero(-normals[:, 2] > np.cos(TILTED))
    together = normals[below] @ normals[below].T > np.cos(_COPLANAR)
    covered = together @ areas[below]
    if not len(below):
        return None
    best = int(np.argmax(covered))
    others = covered[~together[best]].max(initial=0.0)
    if covered[best] < max(0.1 * hull.area, 1.5 * others):
        return None
    largest = below[best]
    same = normals @ normals[largest] > np.cos(_COPLANAR)
    return quat_between(areas[same] @ normals[same], np.array([0.0, 0.0, -1.0])), covered[best]


def sole_heading(points: Float[np.ndarray, "P 3"]) -> float:
    """The angle [rad] from X to the long side of a sole; 0 where no side is clearly the long one,
    or it points more to the side than ahead."""
    flat = points[_lowest(points), :2]
    flat = flat - (flat.max(0) + flat.min(0)) / 2
    spread, ways = np.linalg.eigh(flat.T @ flat)
    if spread[0] > _LONG**2 * spread[1]:
        return 0.0
    x, y = ways[:, 1] * np.sign(ways[0, 1] or 1.0)
    angle = float(np.arctan2(y, x))
    return angle if abs(angle) < np.radians(45) else 0.0


def _lowest(points: Float[np.ndarray, "P 3"]) -> Int[np.ndarray, "_"]:
    length = float(np.ptp(points[:, 0]))
    return np.flatnonzero(points[:, 2] <= points[:, 2].min() + _NEAR_LOWEST * length)
