"""What of a foot, beyond its sole's corners, is lowest while it is tilted: round toes and heels,
and the instep of one who lies on it."""

from collections.abc import Sequence
from itertools import product

import mujoco
import numpy as np
from jaxtyping import Float

from robots.model.hull import outlines, reaching
from spark.rotation import quat_between, quat_rotate

# Tilts of a foot that stands, and of one that lies.
_STANDING, _LYING = np.radians([20.0, 40.0, 60.0]), np.radians([80.0, 100.0, 120.0])
_SPARED = 0.005  # hip heights by which it may then reach below what is known of it
_SIDES = np.linspace(0, 2 * np.pi, 17)[:-1]


def rim(
    model: mujoco.MjModel,
    geoms: Sequence[int],
    down: Float[np.ndarray, "3"],
    corners: Float[np.ndarray, "C 3"],
    hip_height: float,
) -> tuple[Float[np.ndarray, "P 3"], Float[np.ndarray, "P"], int]:
    """Points of a foot's shapes and the radius of the ball around each that are lower than the
    `corners` of its sole when it is tilted; and how many of them, the first, are so while it
    stands: tilted by up to 60 degrees. All in the rest pose [m], where the foot's sole faces the
    direction `down`."""
    upright = quat_between(np.array([0.0, 0.0, -1.0]), down)
    kept, kept_radii, counts = corners, np.zeros(len(corners)), []
    for tilts in (_STANDING, _LYING):
        ways = quat_rotate(upright, _tilted_down(tilts))
        balls = outlines(model, geoms, ways)
        kept, kept_radii = reaching(ways, balls, (kept, kept_radii), _SPARED * hip_height)
        counts.append(len(kept) - len(corners))
    return kept[len(corners) :], kept_radii[len(corners) :], counts[0]


def _tilted_down(tilts: Float[np.ndarray, "A"]) -> Float[np.ndarray, "D 3"]:
    """Unit vectors around straight down."""
    return np.array(
        [
            (np.sin(tilt) * np.cos(side), np.sin(tilt) * np.sin(side), -np.cos(tilt))
            for tilt, side in product(tilts, _SIDES)
        ]
    )
