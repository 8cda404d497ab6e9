"""The lowest points of a model's parts."""

from functools import lru_cache

import mujoco
import numpy as np
from jaxtyping import Float

from sim.outline import fibonacci_sphere, outline, solid
from sim.report.model_poses import ModelPoses, part_name
from sim.trajectory import ModelTrajectory
from spark.rotation import quat_conj, quat_rotate

# Of round meshes the lowest point is found to within a millimetre or so.
_DETAIL = {"ellipsoid": fibonacci_sphere(200), "mesh": fibonacci_sphere(100)}
_RING = 16  # points on either edge of a cylinder


def lowest_points(
    body: ModelTrajectory, poses: ModelPoses, feet: dict[int, str]
) -> tuple[tuple[str, ...], Float[np.ndarray, "T B 3"], tuple[int, ...]]:
    """The names of the model's parts, the lowest point of each [m, world], and its first body.

    They are those of the solid shapes (`sim.outline`); of round meshes to within a millimetre.
    `feet` are what those parts are called that carry soles.
    """
    outlines = _outlines(body.model, tuple(poses.bodies.tolist()))
    names = tuple(feet.get(part) or part_name(body.model, part) for part in outlines)
    lowest = np.zeros((len(body.qpos), len(outlines), 3))
    for k, pieces in enumerate(outlines.values()):
        least = np.full(len(body.qpos), np.inf)
        for at, points, radius in pieces:
            place = _lowest(poses.pos[:, at], poses.quat[:, at], points)
            place[:, 2] -= radius
            better = place[:, 2] < least
            lowest[better, k], least[better] = place[better], place[better, 2]
    return names, lowest, tuple(outlines)


@lru_cache(maxsize=4)  # meshes have many vertices, and a model many motions
def _outlines(
    model: mujoco.MjModel, bodies: tuple[int, ...]
) -> dict[int, list[tuple[int, Float[np.ndarray, "P 3"], float]]]:
    """The shapes of each part: the body that carries one, and its outline in that body's axes."""
    weld = model.body_weldid
    geoms = [int(g) for g in np.flatnonzero(np.isin(model.geom_bodyid, bodies))]
    found: dict[int, list[tuple[int, Float[np.ndarray, "P 3"], float]]] = {}
    for g in solid(model, geoms):
        points, radius = outline(model, g, **_DETAIL, ring=_RING)
        if len(points):
            at = int(model.geom_bodyid[g])
            placed = quat_rotate(model.geom_quat[g], points) + model.geom_pos[g]
            found.setdefault(int(weld[at]), []).append((at, placed, radius))
    return found


def _lowest(
    pos: Float[np.ndarray, "T 3"], quat: Float[np.ndarray, "T 4"], points: Float[np.ndarray, "P 3"]
) -> Float[np.ndarray, "T 3"]:
    """The lowest of a body's points [m, world]."""
    up = quat_rotate(quat_conj(quat), np.array([0.0, 0.0, 1.0]))
    return pos + quat_rotate(quat, points[(up @ points.T).argmin(axis=1)])
