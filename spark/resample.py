"""Motions at fractional frames."""

import numpy as np
from jaxtyping import Float

from spark.rotation import quat_slerp


def rotations_at(
    rotations: Float[np.ndarray, "T J 4"], at: Float[np.ndarray, "N"]
) -> Float[np.ndarray, "N J 4"]:
    """Rotations at fractional frames; the first and last frame hold beyond the ends."""
    low, high, share = _neighbours(at, len(rotations))
    mix = np.broadcast_to(share[:, None], (len(at), rotations.shape[1]))
    return quat_slerp(rotations[low], rotations[high], mix)


def positions_at(
    path: Float[np.ndarray, "T 3"], at: Float[np.ndarray, "N"]
) -> Float[np.ndarray, "N 3"]:
    """A path at fractional frames; the first and last frame hold beyond the ends."""
    low, high, share = _neighbours(at, len(path))
    return path[low] + share[:, None] * (path[high] - path[low])


def _neighbours(
    at: Float[np.ndarray, "N"], count: int
) -> tuple[np.ndarray, np.ndarray, Float[np.ndarray, "N"]]:
    at = np.clip(at, 0, count - 1)
    low = np.minimum(at.astype(int), max(count - 2, 0))
    return low, np.minimum(low + 1, count - 1), at - low
