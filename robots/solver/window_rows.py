"""Residuals of a few frames as forces on bodies, and their Jacobian in one product.

The derivative of a residual by a dof is the product of a wrench with the dof's twist (Lynch and
Park, "Modern Robotics", ch. 3): of a point p's place along n that of (p x n, n), of a direction d's
that of (d x n, 0).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float


class Rows(NamedTuple):
    """R residuals in T frames: their wrenches about the world's origin, and by how much each dof
    moves what they act on (0 or, of what two bodies do to each other, a sign); all weighted."""

    wrenches: Float[np.ndarray, "T R 6"]
    moving: Float[np.ndarray, "R D"]
    residuals: Float[np.ndarray, "T R"]


def stacked(
    rows: Sequence[Rows], twists: Float[np.ndarray, "T 6 D"]
) -> tuple[Float[np.ndarray, "T R D"], Float[np.ndarray, "T R"]]:
    """The Jacobian of some rows by dofs with these twists, and the residuals."""
    wrenches, moving, residuals = zip(*rows, strict=True)
    J = np.concatenate(wrenches, axis=1) @ twists
    J *= np.concatenate(moving)
    return J, np.concatenate(residuals, axis=1)
