"""Which parts carry a body that lies, kneels or crawls, though its recording hovers over the floor.

Skeletons and floors are off by some centimetres, so that a back or a forearm seems to be in the
air. But where the floor pushes in all is known: at the centre of pressure. Of all ways to share
that out among points, the one is taken that asks the least of high ones.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.optimize import nnls

from sim.report.derivatives import derivative
from sim.report.mass import Mass
from sim.report.wrench import angular_momentum
from spark.constants import GRAVITY
from spark.runs import true_runs

MAX_HOVER = 0.12  # [m, of an adult] over the floor of a part that carries,
MIN_SHARE = 0.06  # of the push that it gives,
MIN_PUSH = 0.35  # [body weights] and of that in all
# What is as bad as no push at all: [m, of an adult] that it comes from so high, and that the centre
# of pressure lies so far off. The latter is the dearer one: points high up explain where it is.
_HIGH, _OFF = 0.3, 0.1
COMING_DOWN = 0.05  # [m, of an adult] above where it lies, of a knee that is not down
_LEAST = 0.01  # [m, of an adult] of a height that counts: points on the floor share evenly
_WINDOW = 0.05  # [s] before and after a frame over which rates are measured


class Points(NamedTuple):
    """Where points are [m, world], and how high [m] over the floor the flesh around them."""

    places: Float[np.ndarray, "T K 3"]
    heights: Float[np.ndarray, "T K"]


def carrying(
    mass: Mass, parts: Points, soles: Points, floor_z: float, frame_time: float, scale: float
) -> Bool[np.ndarray, "T K"]:
    """Which of the parts carry the body, beside the soles. `scale` is its size in adults.

    Shares s >= 0 of the push, at p, sum to 1, and s p to the centre of pressure; each costs its
    height. With the centre of mass c, z over the floor, and the angular momentum L for unit mass,
    that is c - z c'' / (z'' + g) + (-L_y', L_x') / (z'' + g) (Vukobratovic's zero-moment point;
    Kajita et al. 2003, eq. 3).
    """
    low = parts.heights < MAX_HOVER * scale
    out = np.zeros_like(low)
    force = derivative(mass.com, frame_time, 2, _WINDOW)
    force[:, 2] += GRAVITY
    frames = np.flatnonzero(low.any(axis=1) & (force[:, 2] > MIN_PUSH * GRAVITY))
    if not len(frames):
        return out
    rate = derivative(angular_momentum(mass, frame_time), frame_time, 1, _WINDOW)
    moment = np.stack([-rate[:, 1], rate[:, 0]], axis=1)
    moment -= (mass.com[:, 2:] - floor_z) * force[:, :2]
    pressure = mass.com[:, :2] + moment / force[:, 2:]
    places, heights = (np.concatenate(pair, axis=1) for pair in zip(parts, soles, strict=True))
    for t in frames.tolist():
        away = (places[t, :, :2] - pressure[t]).T / (_OFF * scale)
        cost = np.diag(np.maximum(heights[t], _LEAST * scale) / (_HIGH * scale))
        rows = np.vstack([np.ones(len(cost)), away, cost])
        shares, _ = nnls(rows, np.append(1.0, np.zeros(len(rows) - 1)))
        out[t] = low[t] & (shares[: low.shape[1]] > MIN_SHARE)
    return out


def once_down(
    touching: Bool[np.ndarray, "T"], height: Float[np.ndarray, "T"]
) -> Bool[np.ndarray, "T"]:
    """Of the times in which a knee touches, or carries though it is so high [m, of an adult]: each
    from where it is first about as low as it lies then (the lower quartile) to where it last is.
    Who kneels down is carried by the knee once it is down."""
    out = np.zeros_like(touching)
    for start, stop in true_runs(touching):
        run = height[start:stop]
        down = start + np.flatnonzero(run < np.percentile(run, 25) + COMING_DOWN)
        out[down[0] : down[-1] + 1] = True
    return out
