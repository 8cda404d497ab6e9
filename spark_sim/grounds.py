"""Stated ground, read from a file for a motion."""

from pathlib import Path
from typing import Final

from spark.errors import FileFormatError
from spark.io.convention import Convention
from spark.io.terrain_file import MESHES, read_terrain
from spark.terrain import Terrain

MODELS: Final = (".xml", ".mjcf", ".urdf")


def read_ground(path: Path, convention: Convention) -> tuple[Terrain, tuple[str, ...]]:
    """What a file states of the ground under a motion [m, world], and notes. A mesh has the unit
    and axes of the motion's file, its `convention`. Raises what `read_terrain` raises."""
    suffix = path.suffix.lower()
    if suffix in MESHES:
        note = f"{path.name}: read as the motion's file, unit {convention.unit}, {convention.up} up"
        return read_terrain(path, convention), (note,)
    if suffix in MODELS:
        from robots.model.fixed_shapes import read_fixed_shapes

        terrain, notes = read_fixed_shapes(path)
        return terrain, (f"{path.name}: its fixed shapes are the ground, in metres, Z up", *notes)
    raise FileFormatError(
        path, None, f"is no terrain; expected a mesh or a model: {', '.join(MESHES + MODELS)}"
    )
