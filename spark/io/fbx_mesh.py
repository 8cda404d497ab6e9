"""The triangles of a mesh in an FBX file: polygons are cut into fans, and each triangle's corners
have the normals, texture coordinates and colours that the file gives them."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from spark.io.fbx_document import Element
from spark.io.scanner import LARGEST


@dataclass(frozen=True, eq=False)
class FbxMesh:
    """A mesh in its own units and axes.

    Vertex v lies at `points[at[v]]`; points have as many vertices as they have different normals
    and texture coordinates. `materials[f]` is the place of a face's material among its node's.
    """

    points: Float[np.ndarray, "P 3"]
    at: Int[np.ndarray, "V"]
    normals: Float[np.ndarray, "V 3"] | None
    uv: Float[np.ndarray, "V 2"] | None
    faces: Int[np.ndarray, "F 3"]
    materials: Int[np.ndarray, "F"]


def read_mesh(geometry: Element) -> FbxMesh:
    """The mesh of an element `Geometry`. Raises `ValueError` where numbers don't go together."""
    points = geometry.numbers("Vertices")
    loops = geometry.numbers("PolygonVertexIndex").astype(np.int64)
    if len(points) % 3 or not (np.abs(points) <= LARGEST).all():
        raise ValueError(f"the points of a mesh are no numbers up to {LARGEST:g}, three each")
    points = points.reshape(-1, 3)
    last = loops < 0  # the last corner of a polygon is written as -1 - index
    corners = np.where(last, -1 - loops, loops)
    if len(corners) and not (last[-1] and corners.max() < len(points)):
        raise ValueError(f"a mesh has a corner at point {corners.max()} of {len(points)}")
    ends = np.flatnonzero(last)
    starts = np.r_[0, ends[:-1] + 1]
    polygon = np.repeat(np.arange(len(ends)), ends - starts + 1)

    def layer(name: str, data: str, width: int) -> Float[np.ndarray, "C w"] | None:
        return _of_corners(geometry.first(name), data, width, corners, polygon)

    normals = layer("LayerElementNormal", "Normals", 3)
    uv = layer("LayerElementUV", "UV", 2)
    material = layer("LayerElementMaterial", "Materials", 1)
    fans = np.maximum(ends - starts - 1, 0)
    of = np.repeat(np.arange(len(ends)), fans)
    k = np.arange(len(of)) - np.repeat(np.cumsum(fans) - fans, fans)
    faces = np.stack([starts[of], starts[of] + k + 1, starts[of] + k + 2], axis=1)
    at, faces, chosen = _welded(corners, faces, normals, uv)
    return FbxMesh(
        points,
        at,
        None if normals is None else normals[chosen],
        None if uv is None else uv[chosen],
        faces,
        np.zeros(len(of), np.int64) if material is None else material[starts[of], 0].astype(int),
    )


def _of_corners(
    layer: Element | None,
    data: str,
    width: int,
    corners: Int[np.ndarray, "C"],
    polygon: Int[np.ndarray, "C"],
) -> Float[np.ndarray, "C w"] | None:
    """What a layer says of each corner; None where it says nothing."""
    if layer is None or not len(values := layer.numbers(data)) or len(values) % width:
        return None
    rows = values.reshape(-1, width).astype(float)
    match layer.value("MappingInformationType"):
        case "ByPolygonVertex":
            at = np.arange(len(corners))
        case "ByVertice" | "ByVertex":
            at = corners
        case "ByPolygon":
            at = polygon
        case "AllSame":
            at = np.zeros(len(corners), np.int64)
        case _:
            return None
    index = layer.numbers(f"{data}Index").astype(np.int64)
    # The numbers of materials are an index themselves.
    if layer.value("ReferenceInformationType") != "Direct" and len(index):
        if len(at) and at.max() >= len(index):
            raise ValueError(f"a mesh has {len(index)} {data} for {at.max() + 1} corners")
        at = index[at]
    if len(at) and not 0 <= at.min() <= at.max() < len(rows):
        raise ValueError(f"a mesh has {len(rows)} {data}, of which one is number {at.max()}")
    return rows[at] if (np.abs(rows) <= LARGEST).all() else None


def _welded(
    corners: Int[np.ndarray, "C"],
    faces: Int[np.ndarray, "F 3"],
    *layers: Float[np.ndarray, "C _"] | None,
) -> tuple[Int[np.ndarray, "V"], Int[np.ndarray, "F 3"], Int[np.ndarray, "V"]]:
    """Points of vertices, faces of vertices, and a corner of each: corners that are alike in all
    layers are one vertex."""
    rows = np.column_stack([corners, *(np.float32(x) for x in layers if x is not None)])
    rows = np.ascontiguousarray(rows + 0.0)  # no -0.0
    keys = rows.view(np.dtype((np.void, rows.dtype.itemsize * rows.shape[1]))).ravel()
    _, chosen, vertex = np.unique(keys, return_index=True, return_inverse=True)
    return corners[chosen], vertex.ravel()[faces], chosen
