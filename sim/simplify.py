"""Meshes with fewer faces, for looking at: vertices that share a cell of a grid become one.

Rossignac and Borrel, "Multi-resolution 3D approximations for rendering complex scenes" (1993).
"""

import numpy as np
from jaxtyping import Float, Int

# Of the faces that a surface of area A has after clustering, about this many fall on cell² of it.
_FACES_A_CELL = 2.5


def cell_for(area: float, faces: int) -> float:
    """The edge of the grid's cells that leaves about `faces` faces on a surface of `area`."""
    return float(np.sqrt(_FACES_A_CELL * area / faces))


def area(vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]) -> float:
    """The area of all faces together."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=-1).sum() / 2)


def simplify(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"], cell: float
) -> tuple[Float[np.ndarray, "W 3"], Int[np.ndarray, "G 3"]]:
    """The mesh on a grid of cells with this edge; every vertex of it is the mean of those it stands
    for. Faces that shrink to a line are dropped, and of equal ones all but one. A mesh of which
    nothing would be left stays as it is; cells are at most an eighth of its extent."""
    cell = min(cell, float(np.ptp(vertices, axis=0).max()) / 8)
    place = np.floor((vertices - vertices.min(0)) / cell).astype(np.int64)
    width = place.max(0) + 1
    key = (place[:, 0] * width[1] + place[:, 1]) * width[2] + place[:, 2]
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
