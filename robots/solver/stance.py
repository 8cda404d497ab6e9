"""Footprints that don't overlap: a robot's soles are wider than feet are, and may stand where the
source's would be in each other."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from robots.solver.footprints import FootPlan, on_prints
from spark.runs import true_runs

_APART = 0.005  # [m] between two soles, at least
_SWEEPS = 3  # over all pairs: a footprint may have neighbours in time on both sides


def apart(plans: Sequence[FootPlan]) -> list[FootPlan]:
    """Footprints of two feet that overlap while both stand, each shifted by half of what parts
    them, as a whole; of other robots as they are."""
    if len(plans) != 2:
        return list(plans)
    prints = [plan.prints.copy() for plan in plans]
    runs = [true_runs(plan.stands) for plan in plans]
    meetings = [
        (slice(*one), slice(*other), np.arange(max(one[0], other[0]), min(one[1], other[1])))
        for one in runs[0]
        for other in runs[1]
        if max(one[0], other[0]) < min(one[1], other[1])
    ]
    if not meetings:
        return list(plans)
    together = np.concatenate([both for *_, both in meetings])

    def overlap(both: Int[np.ndarray, "S"]) -> Float[np.ndarray, "S 2"]:
        return _parting(*(_on_floor(plan, x[both]) for plan, x in zip(plans, prints, strict=True)))

    for _ in range(_SWEEPS):
        if not overlap(together).any():
            break
        for one, other, both in meetings:
            shifts = overlap(both)
            most = shifts[np.linalg.norm(shifts, axis=1).argmax()]
            prints[0][one, :2] -= most / 2
            prints[1][other, :2] += most / 2
    return [replace(plan, prints=own) for plan, own in zip(plans, prints, strict=True)]


def _on_floor(plan: FootPlan, prints: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T P 2"]:
    points = on_prints(plan.flat, prints[:, 0] + 1j * prints[:, 1], prints[:, 2])
    return np.stack([points.real, points.imag], axis=-1)


def _parting(
    one: Float[np.ndarray, "T P 2"], other: Float[np.ndarray, "T P 2"]
) -> Float[np.ndarray, "T 2"]:
    """The shortest shift of `other` that parts it from `one`; 0 where they are apart. Directions
    across and along both soles are tried, as by the separating axis theorem (Gottschalk et al.
    1996)."""
    ahead = [points[:, -2:].mean(1) - points[:, :2].mean(1) for points in (one, other)]
    axes = np.stack([axis for way in ahead for axis in (way, way[:, ::-1] * [1.0, -1.0])], axis=1)
    axes /= np.maximum(np.linalg.norm(axes, axis=-1, keepdims=True), 1e-9)
    axes = np.concatenate([axes, -axes], axis=1)
    reach = np.einsum("tki,tpi->tkp", axes, one).max(-1)
    near = np.einsum("tki,tpi->tkp", axes, other).min(-1)
    depth = reach + _APART - near
    best = depth.argmin(axis=1)
    at = np.arange(len(one))
    return np.maximum(depth[at, best], 0.0)[:, None] * axes[at, best]
