"""Smoothstep, by which weights fade everywhere."""

import numpy as np
from jaxtyping import Float


def smoothstep(share: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    """From 0 at a share of 0 and less to 1 at 1 and more, level at both ends: 3 u² - 2 u³."""
    u = np.clip(share, 0, 1)
    faded: Float[np.ndarray, "*n"] = u * u * (3 - 2 * u)
    return faded
