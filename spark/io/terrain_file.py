"""Stated ground as mesh files have it: OBJ by ourselves, other meshes by trimesh."""

import io
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np
from jaxtyping import Float, Int

from spark.errors import DependencyError, FileFormatError
from spark.files import write_atomically
from spark.io.convention import Convention
from spark.opening import read_bytes
from spark.terrain import Terrain

MESHES: Final = (".obj", ".stl", ".ply", ".glb", ".off")
_LARGEST = 256 << 20  # bytes
_FARTHEST = 1e6  # [m] from the origin
_EXPECTED = "a mesh (" + ", ".join(MESHES) + ")"


def read_terrain(path: Path, convention: Convention) -> Terrain:
    """The triangles of a mesh, in the unit and axes of a motion's file.

    Raises `FileFormatError` where it is missing, broken or empty, and `DependencyError` where it is
    no OBJ and trimesh is missing.
    """
    data = read_bytes(path, limit=_LARGEST, expected=_EXPECTED)
    if path.suffix.lower() == ".obj":
        vertices, faces = _obj(path, data)
    else:
        vertices, faces = _mesh(path, data)
    return checked(path, convention.from_file(vertices), faces)


def checked(
    path: Path, vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> Terrain:
    """Stated ground of a file. Raises `FileFormatError` where that has no surface."""
    if not len(faces):
        raise FileFormatError(path, None, "has no faces: a terrain is a surface")
    used = np.unique(faces)
    if used[0] < 0 or used[-1] >= len(vertices):
        raise FileFormatError(
            path, None, f"has a face with a vertex that is not there: {used[-1] + 1}"
        )
    if not np.isfinite(vertices[used]).all():
        raise FileFormatError(path, None, "has a vertex that is no number")
    if np.abs(vertices[used]).max() > _FARTHEST:
        raise FileFormatError(path, None, f"has a vertex beyond {_FARTHEST:g} m: check its unit")
    if np.ptp(vertices[used, :2], axis=0).min() <= 0.0:
        raise FileFormatError(path, None, "has no surface to stand on: all of it is upright")
    return Terrain(vertices[used], np.searchsorted(used, faces))


def write_obj(terrain: Terrain, path: Path) -> None:
    """Write stated ground as an OBJ [m, Z up]. Raises `OutputError` where that can't be written."""
    rows = ["# spark-sim: terrain, in metres, Z up"]
    rows += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in terrain.vertices.tolist()]
    rows += [f"f {a} {b} {c}" for a, b, c in (terrain.faces + 1).tolist()]
    write_atomically(path, ("\n".join(rows) + "\n").encode())


def _obj(path: Path, data: bytes) -> tuple[Float[np.ndarray, "V 3"], Int[np.ndarray, "F 3"]]:
    vertices: list[list[float]] = []
    faces: list[tuple[int, int, int]] = []
    for number, line in enumerate(data.decode("utf-8", "replace").splitlines(), start=1):
        kind, *words = line.split() or [""]
        try:
            if kind == "v":
                x, y, z = map(float, words[:3])
                vertices.append([x, y, z])
            elif kind == "f":
                corners = [int(word.split("/")[0]) for word in words]
                corners = [c - 1 if c > 0 else len(vertices) + c for c in corners]
                if len(corners) < 3 or min(corners) < 0:
                    raise ValueError
                faces += [(corners[0], *pair) for pair in pairwise(corners[1:])]
        except ValueError:
            expected = "three numbers" if kind == "v" else "three vertices or more"
            raise FileFormatError(
                path, number, f"{line.strip()[:40]!r}; expected {expected}"
            ) from None
    return np.array(vertices).reshape(-1, 3), np.array(faces, dtype=np.int64).reshape(-1, 3)


def _mesh(path: Path, data: bytes) -> tuple[Float[np.ndarray, "V 3"], Int[np.ndarray, "F 3"]]:
    try:
        import trimesh
    except ImportError as error:
        raise DependencyError(
            f"{path}: a terrain that is no .obj needs trimesh: pip install 'spark-sim[mesh]'"
        ) from error
    kind = path.suffix.lower().lstrip(".")
    try:
        mesh: Any = trimesh.load(io.BytesIO(data), file_type=kind, force="mesh", process=False)
        vertices = np.asarray(mesh.vertices, dtype=np.float64)
        faces = np.asarray(mesh.faces, dtype=np.int64)
    except Exception as error:  # of trimesh or what it reads with, which have all kinds
        what = " ".join(str(error).split())[:120] or type(error).__name__
        raise FileFormatError(
            path, None, f"can't be read as a {kind.upper()} mesh: {what}"
        ) from error
    return vertices.reshape(-1, 3), faces.reshape(-1, 3)
