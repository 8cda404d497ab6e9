"""What a body sits on: told from where it rests though its feet can't carry it.

No recording says where a chair is. But a body that is at rest far behind its feet is held there
(its centre of pressure; Kajita et al. 2003, eq. 3), and where neither hands nor knees are near the
floor its seat does that. Who squats, kneels or lies sits on nothing, nor who sits on the floor.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from spark.rig.contacts import ADULT_HEIGHT, climbing_speeds, speeds
from spark.rig.roles import Role
from spark.runs import true_runs
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.hip_sway import center_of_mass
from spark.transfer.pressure import beyond_feet

FLESH = 0.055  # standing heights from the middle of the hips down to the seat
# All lengths [m] are of an adult.
MIN_BEYOND = 0.1  # from the feet to the centre of pressure: recorded bodies are off by less
MAX_HIPS = 0.9  # hip heights of a T-pose up to which a body sits
MAX_SPEED = 0.15  # [m/s] of hips at rest
MIN_TIME = 0.4  # [s] that they are
SAME_SEAT, SAME_PLACE = 0.05, 0.15  # up or down, and along the floor, of who still sits there
ON_FLOOR = 0.15  # over the floor: what is lower carries the body, or is the seat itself
_OTHERS = tuple(role for role in Role if role.part in ("hand", "forearm", "lower_leg", "head"))


class Seat(NamedTuple):
    """That a body sits in the frames from `start` up to `stop`, the middle of its hips so `high`
    [m] over the floor."""

    start: int
    stop: int
    high: float


def seats_of(source: CanonicalMotion) -> tuple[Seat, ...]:
    """Where a motion sits on more than its floor, in time's order."""
    rig, frame_time = source.rig, source.frame_time
    scale, flesh = rig.standing_height / ADULT_HEIGHT, FLESH * rig.standing_height
    hips = source.hips[:, 2] - source.floor_z
    calm = (hips > flesh + ON_FLOOR * scale) & (hips < MAX_HIPS * rig.hip_height)
    for speed in (speeds, climbing_speeds):
        calm &= speed(source.hips[:, None], frame_time)[:, 0] < MAX_SPEED * scale
    least, found = max(2, round(MIN_TIME / frame_time)), []
    for start, stop in true_runs(calm):
        if stop - start < least:
            continue
        held = start + np.flatnonzero(_held(source.frames(start, stop), scale))
        if len(held) >= least:
            high, place = np.median(hips[held]), np.median(source.hips[held, :2], axis=0)
            sits = np.abs(hips - high) < SAME_SEAT * scale
            sits &= np.linalg.norm(source.hips[:, :2] - place, axis=1) < SAME_PLACE * scale
            found += [
                Seat(first, last, float(high))
                for first, last in true_runs(sits)
                if ((held >= first) & (held < last)).any()
            ]
    return tuple(dict.fromkeys(found))


def _held(source: CanonicalMotion, scale: float) -> Bool[np.ndarray, "T"]:
    """When something holds a body that is neither its feet nor what of it is near the floor."""
    roles = source.rig.roles
    others = [j for role in _OTHERS for j in roles.joints(role)]
    away: Float[np.ndarray, T] = beyond_feet(source, center_of_mass(source)) * source.rig.hip_height
    heights = canonical_positions(source, others)[..., 2] - source.floor_z
    return (away > MIN_BEYOND * scale) & (heights.min(axis=1, initial=np.inf) > ON_FLOOR * scale)
