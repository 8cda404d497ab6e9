"""A character stands on its own soles, not on those of the body that it is moved by.

A transfer stands as high over z = 0 as the source does, for its size: in the source's shoes. Where
the source itself stands steadily on z = 0, that height is its shoes', and the target's own take
their place. Of a source that hovers, sinks or climbs, nothing tells shoes from error.
"""

from dataclasses import replace

import numpy as np

from spark.rig.standing import STEADY, THICKEST, USUAL, on_zero, same_feet
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.leg_fit import fit_legs
from spark.transfer.soles import sole_paths, still_feet

_DECILES = (10, 50, 90)


def fit_body(
    source: CanonicalMotion, moved: CanonicalMotion, recording: CanonicalMotion | None = None
) -> CanonicalMotion:
    """`moved`, the transfer of `source`, with its legs fitted by proportions, on its own soles."""
    return on_own_soles(source, fit_legs(source, moved), recording)


def on_own_soles(
    source: CanonicalMotion, moved: CanonicalMotion, recording: CanonicalMotion | None = None
) -> CanonicalMotion:
    """`moved`, a transfer of `source`, so high over z = 0 as its own soles are: as high as in
    `recording`, a motion of its own, if that stands on z = 0, else as high as usual. Itself where
    the two bodies have the same feet, or the source tells nothing."""
    rig = moved.rig
    if same_feet(source.rig, rig) or not _steady_on_zero(source):
        return moved
    own = USUAL * rig.hip_height
    if recording is not None and on_zero(rig, recording.floor_z):
        own = float(np.clip(recording.floor_z, 0.0, THICKEST * rig.hip_height))
    up = own - moved.floor_z
    return replace(moved, hips=moved.hips + np.array([0.0, 0.0, up]), floor_z=moved.floor_z + up)


def _steady_on_zero(source: CanonicalMotion) -> bool:
    """Whether the soles that are still are as high at all times, and they and the floor under the
    lowest as high over z = 0 as shoes are thick."""
    rig = source.rig
    if not on_zero(rig, source.floor_z):
        return False
    over_floor, ends = sole_paths(source)
    heights = over_floor[still_feet(ends, rig.standing_height, source.frame_time)]
    if not len(heights):
        return False
    low, middle, high = np.percentile(heights, _DECILES).tolist()
    steady = high - low < STEADY * rig.hip_height
    return steady and on_zero(rig, middle + source.floor_z)
