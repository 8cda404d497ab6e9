"""Whether a body stands on its feet, or leans on its arms."""

import numpy as np
from jaxtyping import Float

from spark.smoothstep import smoothstep

_LOW = 0.15  # [m, of an adult] of a heel or toe above the floor that may stand; what is higher is
_HIGHER = 0.5  # by this share of that as far away
# [m, of an adult] along the floor from the mass to what lies between the feet: nearer, arms don't
# carry; farther, they do.
_NEAR, _FAR = 0.1, 0.25


def on_arms(
    mass: Float[np.ndarray, "T 2"], feet: Float[np.ndarray, "T P 3"], adult: float
) -> Float[np.ndarray, "T"]:
    """How far (0 to 1) a body leans on its arms, of which the mass is over a place of the floor and
    heels and toes are at some places above it [m]; 1 without feet. `adult` is its size in adults.
    """
    if not feet.shape[1]:
        return np.ones(len(mass))
    away = feet[..., :2] @ (1, 1j) - (mass @ (1, 1j))[:, None]
    over = _HIGHER * np.maximum(feet[..., 2] / adult - _LOW, 0.0)
    # From each to each: what lies between them is over them, too.
    along = away[:, None] - away[:, :, None]
    nearest = -(away[:, :, None] * along.conj()).real / np.maximum(np.abs(along) ** 2, 1e-12)
    apart = np.abs(away[:, :, None] + np.clip(nearest, 0, 1) * along) / adult
    apart += np.maximum(over[:, None], over[:, :, None])
    share: Float[np.ndarray, T] = smoothstep((apart.min(axis=(1, 2)) - _NEAR) / (_FAR - _NEAR))
    return share
