"""How a recorded answer's path, hips and ankles differ from those of the analytic one.

`spark.transfer.leg_fit` and `spark.transfer.hip_rise`, solved for their numbers by least squares.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from spark.rotation import quat_rotate
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.hip_rise import Standing, hip_rise, lowest
from spark.transfer.leg_fit import from_sole, leg_fit

_WEAKEST = 1e-3  # [hip heights²] of movement; a scale that less depends on stays as it is

# How much of the body an ankle carries, against the hips: foot, toe and half of the leg.
_ANKLES_SHARE = 0.25


def measured_scales(
    theirs: CanonicalMotion, own: CanonicalMotion, legs: Sequence[tuple[Standing, Standing]]
) -> tuple[Float[np.ndarray, "6"], Float[np.ndarray, "6"]]:
    """Differences of `HABITS`, and their weights: `spark.transfer.leg_fit` solved for its
    numbers, each a little drawn to what proportions tell. `legs` are those of both."""
    start, size, other = theirs.rig, own.rig.hip_height, theirs.rig.hip_height
    analytic = leg_fit(start, own.rig)
    outwards = quat_rotate(theirs.rotations[:, start.pelvis], np.array([0.0, 1.0, 0.0]))[:, :2]
    # Over the ground: hips and ankles, by one scale about the origin and one distance outwards.
    columns, known = [np.stack([theirs.hips[:, :2], 0 * outwards], -1)], [own.hips[:, :2]]
    for leg, own_leg in legs:
        rest, own_rest = from_sole(start, leg.joints[1]), from_sole(own.rig, own_leg.joints[1])
        side = np.sign(own_rest[1])
        columns.append(np.stack([leg.ends[:, 1, :2] - rest[1] * outwards, side * outwards], -1))
        known.append(own_leg.ends[:, 1, :2] - own_rest[1] * outwards)
    A, y = np.concatenate(columns).reshape(-1, 2), np.concatenate(known).ravel()
    travelled = float(np.mean(A[:, 0] ** 2)) / other**2
    travel, out = _drawn(A, y, analytic.travel, _WEAKEST * len(A) * other**2)
    # In height: standing hips are moved, and what they move about that is scaled.
    rise = size / other
    lift = theirs.hips[:, 2] - other
    A = np.stack([lift, np.ones_like(lift)], -1)
    # Hips beyond what they rise with the leg that stands, and ankles by what stands under them: the
    # soles. Where `retarget` holds feet, it adds the one and keeps the other.
    low = np.stack([lowest(leg, theirs) for leg, _ in legs])
    heights = own.hips[:, 2] - size - hip_rise(theirs, own, legs, low)
    hips_rise, hips_up = _drawn(A, heights, rise, _WEAKEST * len(A) * other**2)
    floor = theirs.floor_z
    lifted = np.concatenate([leg.sole[..., 2].min(axis=1) - floor for leg, _ in legs])
    heights = np.concatenate([leg.sole[..., 2].min(axis=1) - rise * floor for _, leg in legs])
    A = np.stack([lifted, np.ones_like(lifted)], -1)
    ankles_rise, ankles_up = _drawn(A, heights, rise, _WEAKEST * len(A) * other**2)
    logs = [
        np.log(max(found / told, 1e-3))
        for found, told in (
            (travel, analytic.travel),
            (hips_rise, analytic.hips_rise),
            (ankles_rise, analytic.ankles_rise),
        )
    ]
    scales = np.array([*logs, hips_up / size, ankles_up / size, out / size])
    moves = [travelled, np.var(lift) / other**2, _ANKLES_SHARE * np.var(lifted) / other**2]
    # A clip that crosses a hall says no more of a scale than one that takes a few steps.
    weights = np.array([*np.minimum(moves, 1.0), 1.0, _ANKLES_SHARE, _ANKLES_SHARE])
    return scales, weights


def _drawn(
    A: Float[np.ndarray, "N 2"], y: Float[np.ndarray, "N"], told: float, strength: float
) -> tuple[float, float]:
    """Least squares of two numbers, the first drawn to `told`."""
    pull = np.array([strength, 0.0])
    first, second = np.linalg.solve(A.T @ A + np.diag(pull + 1e-12), A.T @ y + pull * told)
    return float(first), float(second)
