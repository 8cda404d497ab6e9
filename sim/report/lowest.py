"""The lowest points of a model's parts."""

from itertools import product

import mujoco
import numpy as np
from jaxtyping import Float

from sim.report.model_poses import ModelPoses, part_name
from sim.trajectory import ModelTrajectory
from spark.rotation import quat_conj, quat_rotate

_PLANE, _HFIELD, _SPHERE, _CAPSULE, _ELLIPSOID, _CYLINDER, _BOX, _MESH = range(8)
_RING = 16  # points on a cylinder's edge


def lowest_points(
    body: ModelTrajectory, poses: ModelPoses
) -> tuple[tuple[str, ...], Float[np.ndarray, "T B 3"]]:
    """The names of the model's parts, and the lowest point of each [m, world].

    They are those of the shapes that collide, or of all where none does; of round meshes to within
    a millimetre or so. What carries a sole is called a foot, as the soles are.
    """
    model = body.model
    weld = model.body_weldid
    feet = {int(weld[b]): f"{sole.side} foot" for sole in body.soles for b in sole.bodies}
    geoms = [int(g) for g in np.flatnonzero(np.isin(model.geom_bodyid, poses.bodies))]
    colliding = [g for g in geoms if model.geom_contype[g] or model.geom_conaffinity[g]]
    outlines: dict[int, list[tuple[int, Float[np.ndarray, "P 3"], float]]] = {}
    for g in colliding or geoms:
        points, radius = _outline(model, g)
        if len(points):
            at = int(model.geom_bodyid[g])
            placed = quat_rotate(model.geom_quat[g], points) + model.geom_pos[g]
            outlines.setdefault(int(weld[at]), []).append((at, placed, radius))
    names = tuple(feet.get(part) or part_name(model, part) for part in outlines)
    lowest = np.zeros((len(body.qpos), len(outlines), 3))
    for k, pieces in enumerate(outlines.values()):
        least = np.full(len(body.qpos), np.inf)
        for at, points, radius in pieces:
            place = _lowest(poses.pos[:, at], poses.quat[:, at], points)
            place[:, 2] -= radius
            better = place[:, 2] < least
            lowest[better, k], least[better] = place[better], place[better, 2]
    return names, lowest


def _lowest(
    pos: Float[np.ndarray, "T 3"], quat: Float[np.ndarray, "T 4"], points: Float[np.ndarray, "P 3"]
) -> Float[np.ndarray, "T 3"]:
    """The lowest of a body's points [m, world]."""
    up = quat_rotate(quat_conj(quat), np.array([0.0, 0.0, 1.0]))
    return pos + quat_rotate(quat, points[(up @ points.T).argmin(axis=1)])


def _outline(model: mujoco.MjModel, geom: int) -> tuple[Float[np.ndarray, "P 3"], float]:
    """Points in the shape's own axes and the radius [m] around them; none for a plane."""
    kind, size = int(model.geom_type[geom]), model.geom_size[geom]
    if kind == _SPHERE:
        return np.zeros((1, 3)), float(size[0])
    if kind == _CAPSULE:
        return np.array([[0, 0, size[1]], [0, 0, -size[1]]]), float(size[0])
    if kind == _ELLIPSOID:
        scaled = _sphere(200) * size
        return scaled * size / np.linalg.norm(scaled, axis=1, keepdims=True), 0.0
    if kind == _CYLINDER:
        angle = 2 * np.pi * np.arange(_RING) / _RING
        ring = np.stack([size[0] * np.cos(angle), size[0] * np.sin(angle)], axis=1)
        return np.concatenate([np.insert(ring, 2, z, axis=1) for z in (-size[1], size[1])]), 0.0
    if kind == _BOX:
        return np.array(list(product((-1.0, 1.0), repeat=3))) * size, 0.0
    if kind == _MESH:
        mesh = int(model.geom_dataid[geom])
        start, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
        vertices = model.mesh_vert[start : start + count].astype(np.float64)
        return vertices[np.unique((vertices @ _sphere(100).T).argmax(axis=0))], 0.0
    return np.zeros((0, 3)), 0.0


def _sphere(count: int) -> Float[np.ndarray, "N 3"]:
    """Evenly spread directions: a Fibonacci lattice."""
    k = np.arange(count) + 0.5
    z, angle = 1 - 2 * k / count, np.pi * (1 + np.sqrt(5)) * k
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)
