"""Meshes with fewer faces, for looking at: vertices that share a cell of a grid become one.

Rossignac and Borrel, "Multi-resolution 3D approximations for rendering complex scenes" (1993).
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from spark.skin import Skin

Mesh = tuple[Float[np.ndarray, "_ 3"], Int[np.ndarray, "_ 3"]]

# A grid's cells leave about this many faces on cell² of a smooth surface; of others more.
_FACES_A_CELL = 2.5
_PATCHES = (16, 8, 8, 4, 4, 2, 1, 1)  # of a picture, across and down, at each attempt
_SMALL, _CELLS_ACROSS = 0.06, 5  # [m] what hangs on a finger is no wider; cells that part it
_MAX_ATTEMPTS = 5  # at a grid that is coarse enough


def simplify_together(meshes: dict[int, Mesh], faces: int) -> dict[int, Mesh]:
    """The meshes on one grid that leaves them no more than `faces` faces in all, or hardly more."""
    count = sum(len(mesh[1]) for mesh in meshes.values())
    if count <= faces:
        return meshes
    cell = np.sqrt(_FACES_A_CELL * sum(area(*mesh) for mesh in meshes.values()) / faces)
    for _ in range(_MAX_ATTEMPTS):
        fewer = {key: simplify(*mesh, float(cell)) for key, mesh in meshes.items()}
        count = sum(len(mesh[1]) for mesh in fewer.values())
        if count <= faces:
            break
        cell *= 1.05 * np.sqrt(count / faces)
    return fewer


def simplify_skin(skin: Skin, faces: int) -> Skin:
    """The skin with about so many faces, or fewer. Each cell keeps one of its places, with its
    bones: neither is a mean of others. What hangs on a small bone, as on a finger's, has small
    cells. Vertices in one place stay in one, so that the seam of a material or a picture does not
    open; those from elsewhere in a picture keep their own place there."""
    if len(skin.faces) <= faces:
        return skin
    cell = float(np.sqrt(_FACES_A_CELL * area(skin.vertices, skin.faces) / faces))
    _, weld = np.unique(np.round(skin.vertices, 6), axis=0, return_inverse=True)
    weld = weld.ravel()
    places = np.zeros((int(weld.max()) + 1, 3))
    places[weld] = skin.vertices
    side = _sides(places, weld[skin.faces])[weld]
    look = np.zeros(len(skin.vertices), dtype=np.int64)
    look[skin.faces] = skin.material_of[:, None]
    away = skin.vertices - skin.vertices.min(0)
    bone, small = (values[_firsts(weld)] for values in _small_bones(skin))
    for patches in _PATCHES:
        edge = np.minimum(cell, small)[:, None]
        _, place, group = _grouped(*np.floor(away / edge).astype(np.int64).T, side, bone)
        spot = np.floor((skin.uv - skin.uv.min(0)) * patches).astype(np.int64)
        _, first, merged = _grouped(group, look, *spot.T)
        turned = merged[skin.faces]
        a, b, c = place[group[first]][turned].T
        _, kept = np.unique(np.sort(turned, axis=1), axis=0, return_index=True)
        kept = np.sort(kept[((a != b) & (b != c) & (c != a))[kept]])
        if len(kept) <= faces:
            break
        coarser = 1.05 * np.sqrt(len(kept) / faces)
        cell, small = coarser * cell, coarser * small
    at = place[group[first]]
    fewer = replace(
        skin,
        vertices=skin.vertices[at],
        bones_of=skin.bones_of[at],
        weights=skin.weights[at],
        uv=skin.uv[first],
        faces=turned,
    )
    return fewer.with_faces(kept)


def _small_bones(skin: Skin) -> tuple[Int[np.ndarray, "V"], Float[np.ndarray, "V"]]:
    """The bone of the greatest weight of each vertex, 0 for those of size, and the edge of a cell
    [m] that parts what hangs on it, infinite for those of size."""
    strongest = skin.bones_of[np.arange(len(skin.bones_of)), skin.weights.argmax(axis=1)]
    edges = np.full(len(skin.joints), np.inf)
    for b in np.unique(strongest):
        middle = np.sort(np.ptp(skin.vertices[strongest == b], axis=0))[1]
        if middle < _SMALL:
            edges[b] = max(float(middle), _SMALL / 10) / _CELLS_ACROSS
    small = edges[strongest]
    return np.where(np.isfinite(small), 1 + strongest, 0), small


def _firsts(groups: Int[np.ndarray, "V"]) -> Int[np.ndarray, "V"]:
    """For each row, the first row of its group."""
    _, first, number = np.unique(groups, return_index=True, return_inverse=True)
    return first[number]


def _grouped(
    *columns: Int[np.ndarray, "V"],
) -> tuple[Int[np.ndarray, "G"], Int[np.ndarray, "G"], Int[np.ndarray, "V"]]:
    """What `np.unique` gives of rows of small numbers: keys, first rows, groups."""
    key = np.zeros(len(columns[0]), dtype=np.int64)
    for column in columns:
        key = key * (int(column.max()) + 1) + column
    return np.unique(key, return_index=True, return_inverse=True)


def area(vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]) -> float:
    """The area of all faces together."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=-1).sum() / 2)


def simplify(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], cell: float
) -> tuple[Float[np.ndarray, "W 3"], Int[np.ndarray, "G 3"]]:
    """The mesh on a grid of cells with this edge; every vertex of it is the mean of those it stands
    for. Vertices that face other ways stay apart, so that the two sides of a thin shell do. Faces
    that shrink to a line are dropped, and of equal ones all but one. A mesh of which nothing would
    be left stays as it is; cells are at most an eighth of its extent."""
    cell = min(cell, float(np.ptp(vertices, axis=0).max()) / 8)
    place = np.floor((vertices - vertices.min(0)) / cell).astype(np.int64)
    width = place.max(0) + 1
    key = (place[:, 0] * width[1] + place[:, 1]) * width[2] + place[:, 2]
    key = 6 * key + _sides(vertices, faces)
    kept, merged = np.unique(key, return_inverse=True)
    counts = np.bincount(merged, minlength=len(kept))
    sums = np.stack(
        [np.bincount(merged, weights=vertices[:, k], minlength=len(kept)) for k in range(3)], -1
    )
    turned = merged[faces]
    turned = turned[
        (turned[:, 0] != turned[:, 1])
        & (turned[:, 1] != turned[:, 2])
        & (turned[:, 2] != turned[:, 0])
    ]
    # The smallest index first keeps the winding, so that a face and its back stay two.
    first = turned.argmin(1)
    rows = np.arange(len(turned))[:, None]
    turned = turned[rows, (first[:, None] + np.arange(3)) % 3]
    turned = np.unique(turned, axis=0)
    used, renumbered = np.unique(turned, return_inverse=True)
    if len(used) < 4:
        return vertices, faces
    return sums[used] / counts[used, None], renumbered.reshape(-1, 3)


def _sides(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> Int[np.ndarray, "V"]:
    """Which of the six directions along the axes each vertex faces most."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    normals = np.stack(
        [
            np.bincount(faces.ravel(), weights=np.repeat(across[:, k], 3), minlength=len(vertices))
            for k in range(3)
        ],
        axis=-1,
    )
    axis = np.abs(normals).argmax(1)
    return 2 * axis + (np.take_along_axis(normals, axis[:, None], 1)[:, 0] > 0)
