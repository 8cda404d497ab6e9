"""Stated ground as models have it: the fixed shapes of an MJCF's or a URDF's world."""

from pathlib import Path

import mujoco
import numpy as np
from jaxtyping import Float, Int
from scipy.spatial import ConvexHull

from robots.model.compiling import compiled_or_cached
from robots.model.mjcf import parse_model
from sim.outline import all_around, fibonacci_sphere, solid
from spark.errors import FileFormatError
from spark.io.terrain_file import checked
from spark.terrain import Terrain

_MESH, _HFIELD, _PLANE = (
    int(getattr(mujoco.mjtGeom, f"mjGEOM_{kind}")) for kind in ("MESH", "HFIELD", "PLANE")
)
_LOOKS, _RING = fibonacci_sphere(200), 64  # on what is round

Triangles = tuple[Float[np.ndarray, "V 3"], Int[np.ndarray, "F 3"]]


def read_fixed_shapes(path: Path) -> tuple[Terrain, tuple[str, ...]]:
    """The shapes of a model that nothing moves, in metres, Z up, without planes; and notes. Raises
    `FileFormatError` where it can't be read, or has none."""
    notes: list[str] = []
    spec, _ = parse_model(path, notes)
    model = compiled_or_cached(spec, path, notes, lambda: None)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    fixed = np.flatnonzero(model.body_weldid[model.geom_bodyid] == 0)
    shapes = [g for g in fixed.tolist() if int(model.geom_type[g]) != _PLANE]
    found, corners, faces = [], 0, []
    for geom in solid(model, shapes):
        points, own = _triangles(model, geom)
        found.append(points @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
        faces.append(own + corners)
        corners += len(points)
    if not found:
        raise FileFormatError(
            path, None, "has no fixed shapes but planes; a terrain is what is fixed to its world"
        )
    return checked(path, np.concatenate(found), np.concatenate(faces)), tuple(notes)


def _triangles(model: mujoco.MjModel, geom: int) -> Triangles:
    """The surface of a geom, in its own axes."""
    kind = int(model.geom_type[geom])
    if kind == _MESH:
        k = int(model.geom_dataid[geom])
        vertices, faces = (
            values[start : start + count]
            for values, start, count in (
                (model.mesh_vert, model.mesh_vertadr[k], model.mesh_vertnum[k]),
                (model.mesh_face, model.mesh_faceadr[k], model.mesh_facenum[k]),
            )
        )
        return vertices.astype(np.float64), faces.astype(np.int64)
    if kind == _HFIELD:
        return _height_field(model, int(model.geom_dataid[geom]))
    points = all_around(model, geom, _LOOKS, _RING)
    hull = ConvexHull(points)
    a, b, c = points[hull.simplices].swapaxes(0, 1)
    inward = (np.cross(b - a, c - a) * hull.equations[:, :3]).sum(axis=1) < 0.0
    faces = np.where(inward[:, None], hull.simplices[:, ::-1], hull.simplices)
    return points, faces.astype(np.int64)


def _height_field(model: mujoco.MjModel, k: int) -> Triangles:
    rows, columns = int(model.hfield_nrow[k]), int(model.hfield_ncol[k])
    half_x, half_y, top, _ = model.hfield_size[k].tolist()
    start = int(model.hfield_adr[k])
    heights = top * model.hfield_data[start : start + rows * columns].astype(np.float64)
    y, x = np.meshgrid(
        np.linspace(-half_y, half_y, rows), np.linspace(-half_x, half_x, columns), indexing="ij"
    )
    number = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (
        each.ravel()
        for each in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1])
    )
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return np.column_stack([x.ravel(), y.ravel(), heights]), faces
