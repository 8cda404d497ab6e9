"""Stated ground in simulation. MuJoCo takes a mesh for its convex hull: parts that are convex are
there as they are, and the rest as one height field."""

from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float

from spark.summary import counted
from spark.terrain import Terrain

_SPACING = 0.02  # [m] between the heights of a height field,
_MOST = 400_000  # and so many of them at most: of larger grounds they lie farther apart
_BASE = 0.1  # [m] of solid below its lowest height
_FLAT = 1e-4  # of a part's size: by which a corner may be outside of the plane of a side


def add_stated(
    spec: mujoco.MjSpec, terrain: Terrain, floor_z: float, meets: dict[str, int], notes: list[str]
) -> None:
    """Add the ground [m, world] to the world of a spec, over a floor at `floor_z` [m]; what `meets`
    it are the bits of its shapes. How it is there is added to `notes`."""
    convex, rest = _sorted(terrain)
    for number, corners in enumerate(convex):
        name = f"stated ground {number}"
        spec.add_mesh(name=name, uservert=corners.ravel().tolist())
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname=name, **meets)
    there = [f"{counted(len(convex), 'convex part')}, as stated"] if convex else []
    if rest is not None:
        spacing = _add_field(spec, rest, floor_z, meets)
        there.append(
            f"what is not convex as a height field, a height every {100 * spacing:.0f} cm, so that "
            "nothing is below another thing and walls lean by as much"
        )
    notes.append(f"the stated ground is there in simulation: {'; '.join(there)}")


def _sorted(terrain: Terrain) -> tuple[list[Float[np.ndarray, "V 3"]], Terrain | None]:
    """The corners of each convex part, and all other parts."""
    convex, rest = [], np.zeros(len(terrain.faces), dtype=bool)
    for part in range(len(terrain.closed)):
        own = terrain.parts == part
        corners = np.unique(terrain.corners[own].reshape(-1, 3), axis=0)
        if terrain.closed[part] and _is_convex(terrain.corners[own], corners):
            convex.append(corners)
        else:
            rest |= own
    return convex, Terrain(terrain.vertices, terrain.faces[rest]) if rest.any() else None


def _is_convex(sides: Float[np.ndarray, "F 3 3"], corners: Float[np.ndarray, "V 3"]) -> bool:
    """Whether all corners are on one side of the plane of each triangle."""
    size = float(np.ptp(corners, axis=0).max())
    normals = np.cross(sides[:, 1] - sides[:, 0], sides[:, 2] - sides[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    normals = normals[lengths > 0] / lengths[lengths > 0, None]
    over = corners @ normals.T - (normals * sides[lengths > 0, 0]).sum(axis=1)
    return bool(np.minimum(over.max(axis=0), -over.min(axis=0)).max() < _FLAT * size)


def _add_field(
    spec: mujoco.MjSpec, terrain: Terrain, floor_z: float, meets: dict[str, Any]
) -> float:
    """Add what is on top as a height field, a little below the floor where there is nothing. The
    distance [m] between its heights."""
    used = terrain.corners.reshape(-1, 3)
    low, high = used.min(axis=0), used.max(axis=0)
    wide, deep = np.maximum(high - low, _SPACING)[:2].tolist()  # upright walls may be of no width
    spacing = max(_SPACING, float(np.sqrt(wide * deep / _MOST)))
    columns, rows = (max(int(np.ceil(length / spacing)) + 1, 2) for length in (wide, deep))
    # A node on the rim would be beside the ground.
    inset = 1e-4 * spacing
    x, y = np.meshgrid(
        np.linspace(low[0] + inset, high[0] - inset, columns),
        np.linspace(low[1] + inset, high[1] - inset, rows),
    )
    tops = terrain.tops(np.stack([x, y, np.full(x.shape, high[2])], axis=-1), spacing)
    tops = np.maximum(tops, floor_z - _SPACING)
    bottom, height = float(tops.min()), max(float(np.ptp(tops)), 1e-3)
    spec.add_hfield(
        name="stated ground",
        nrow=rows,
        ncol=columns,
        size=[wide / 2, deep / 2, height, _BASE],
        userdata=((tops - bottom) / height).ravel().tolist(),
    )
    spec.worldbody.add_geom(
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="stated ground",
        pos=[(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, bottom],
        **meets,
    )
    return spacing
