"""A skin as the replay's page reads it."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float, Int, UInt8

from sim.view.packing import STEPS, in_base64, packed, short
from sim.view.pictures import jpeg
from spark.skin import INFLUENCES, Skin

_FEW, _SIDE = 4, 256  # with more pictures than this, each is smaller [pixels]
_QUALITY = 80  # of their JPEGs


def page_skin(skin: Skin, bodies: Sequence[int]) -> dict[str, Any]:
    """A skin whose bones go with the figure's bodies of these numbers: 26 bytes a vertex and 12 a
    face, before they are text."""
    order = np.argsort(skin.material_of, kind="stable")
    sizes = np.bincount(skin.material_of, minlength=len(skin.materials)).tolist()
    starts = np.cumsum([0, *sizes]).tolist()
    pad = ((0, 0), (0, INFLUENCES - skin.bones_of.shape[1]))
    uv_scale = max(float(np.abs(skin.uv).max()), 1.0) / STEPS
    normals = np.pad(np.round(127 * smooth_normals(skin.vertices, skin.faces)), ((0, 0), (0, 1)))
    count = sum(material.image is not None for material in skin.materials)
    side = None if count <= _FEW else _SIDE
    return {
        "place": packed(skin.vertices),
        "normals": in_base64(normals.astype("<i1")),
        "uv": in_base64(np.round(skin.uv / uv_scale).astype("<i2")),
        "uv_scale": uv_scale,
        "bones_of": in_base64(np.pad(skin.bones_of, pad).astype("<u2")),
        "weights": in_base64(np.round(255 * np.pad(skin.weights, pad)).astype("<u1")),
        "faces": in_base64(skin.faces[order].astype("<u4")),
        "bones": list(bodies),
        "binds": in_base64(skin.inverse_bind.astype("<f4")),
        "parts": [
            {
                "start": 3 * start,
                "count": 3 * size,
                "rgb": short(np.array(material.rgb)),
                "image": None if material.image is None else _address(material.image, side),
            }
            for material, start, size in zip(skin.materials, starts, sizes, strict=False)
            if size
        ],
    }


def smooth_normals(
    vertices: Float[np.ndarray, "V 3"], faces: Int[np.ndarray, "F 3"]
) -> Float[np.ndarray, "V 3"]:
    """The mean direction that the faces around each vertex face, by their areas. Vertices in one
    place have one: a picture's seam is no edge."""
    _, place = np.unique(np.round(vertices, 5), axis=0, return_inverse=True)
    corners = place.ravel()[faces]
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    across = np.repeat(np.cross(b - a, c - a), 3, axis=0)
    sums = [np.bincount(corners.ravel(), weights=across[:, k]) for k in range(3)]
    normals = np.stack(sums, axis=1)[place.ravel()]
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)


def _address(image: UInt8[np.ndarray, "H W 3"], side: int | None) -> str:
    """An address that holds a picture, which is no larger than `side` [pixels]."""
    return f"data:image/jpeg;base64,{jpeg(image, quality=_QUALITY, side=side)}"
