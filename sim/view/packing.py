"""Numbers as a page takes them: short, or many of them as 16-bit integers in base64."""

import base64
from typing import Any

import numpy as np
from jaxtyping import Float, Shaped

STEPS = 32000  # what is kept as 16-bit integers lies within so many


def short(values: Float[np.ndarray, "N"]) -> list[float]:
    """A few numbers, to six digits."""
    return [round(float(v), 6) for v in values]


def packed(points: Float[np.ndarray, "*N 3"]) -> dict[str, Any]:
    """Points as 16-bit integers: `origin + scale * integer`."""
    if not points.size:
        return {"scale": 1.0, "origin": [0.0, 0.0, 0.0], "points": ""}
    axes = tuple(range(points.ndim - 1))
    low, high = points.min(axes), points.max(axes)
    scale = float(max((high - low).max() / (2 * STEPS), 1e-9))
    origin = (low + high) / 2
    whole = np.round((points - origin) / scale).astype("<i2")
    return {"scale": scale, "origin": short(origin), "points": in_base64(whole)}


def in_base64(values: Shaped[np.ndarray, "*N"]) -> str:
    """The array's bytes."""
    return base64.b64encode(values.tobytes()).decode()
