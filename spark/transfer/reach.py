"""Hips that come down to feet out of reach.

A broad body on short legs takes longer steps than its legs alone would (`travel_scale`), and then
some of its feet stand where a leg does not reach: they would be pulled along, and lifted. People
lower their hips in a wide stance, and so does this. A foot that swings or rolls off is let go of:
the other leg would bend.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.leg_ik import Leg

MAX_REACH = 0.999  # of a leg's length
_AHEAD = 0.15  # [s] before a foot is out of reach the hips begin to come down
_MAX_DROP = 0.1  # [hip heights] of a wide stance; a foot further away is let go of

Moves = Sequence[tuple[Leg, Float[np.ndarray, "T 3"]]]


def within_reach(
    motion: CanonicalMotion, moves: Moves, stands: Bool[np.ndarray, "L #T"]
) -> tuple[CanonicalMotion, Moves]:
    """`motion` with its hips as low as its legs need them to move their ankles by `moves` [m] while
    they stand, and the moves from there."""
    drop = np.max(
        [here * _drop(motion, leg, move) for (leg, move), here in zip(moves, stands, strict=True)],
        axis=0,
    )
    if not drop.any():
        return motion, moves
    size = 2 * round(_AHEAD / motion.frame_time) + 1
    # Of the largest drop near each frame the mean is no less than the frame's own.
    drop = uniform_filter1d(maximum_filter1d(drop, size, mode="nearest"), size, mode="nearest")
    down = drop[:, None] * np.array([0.0, 0.0, 1.0])
    lower = replace(motion, hips=motion.hips - down)
    return lower, [(leg, move + down) for leg, move in moves]


def _drop(
    motion: CanonicalMotion, leg: Leg, move: Float[np.ndarray, "T 3"]
) -> Float[np.ndarray, "T"]:
    """How far the hip has to come down for the leg to reach [m]."""
    at = canonical_positions(motion, [leg.upper_leg, leg.lower_leg, leg.foot])
    hip, knee, ankle = at[:, 0], at[:, 1], at[:, 2]
    length = np.linalg.norm(knee - hip, axis=1) + np.linalg.norm(ankle - knee, axis=1)
    # A leg that was stretched out as it was copied may stay so.
    reach = np.maximum(MAX_REACH * length, np.linalg.norm(ankle - hip, axis=1))
    goal = ankle + move - hip
    below = np.sqrt(np.maximum(reach**2 - goal[:, 0] ** 2 - goal[:, 1] ** 2, 0.0))
    return np.clip(-goal[:, 2] - below, 0.0, _MAX_DROP * motion.rig.hip_height)
