"""Feet that hover for a while where the source's stand, lower than what counts as floating."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from sim.report.clip_metrics import ClipMetrics
from sim.report.contact_timing import Standing
from spark.resample import values_at
from spark.runs import true_runs

# A body hovers whose lowest point keeps further from the floor than this [m, of an adult]: flesh
# under soles is no thicker, and recordings on robots keep 0.6 cm at most.
HOVERS = 0.02
_LASTS = 0.2  # [s]


class Hover(NamedTuple):
    """A foot is up to `height` [m] higher above the floor than the source's in the frames [start,
    stop)."""

    foot: str
    start: int
    stop: int
    height: float


def hovers_of(
    clip: ClipMetrics,
    source: ClipMetrics,
    standing: Standing,
    times: Float[np.ndarray, "T"],
    scale: float,
) -> tuple[Hover, ...]:
    """Where a foot of the source stands, at the same `times` [s], and the sole is higher than its
    by more than `HOVERS`; without frames in which the body floats. `scale` is the hip height over
    the source's."""
    found, at = list[Hover](), times / source.frame_time
    bound = clip.thresholds.of_adult(HOVERS)
    for k, foot in enumerate(standing.names):
        own, theirs = (
            each.sole_heights[:, each.feet.index(foot)].astype(float) for each in (clip, source)
        )
        higher = own - scale * np.maximum(values_at(theirs, at), 0.0)
        hovers = (higher > bound) & standing.theirs[:, k] & ~clip.flags["floating"]
        found += [
            Hover(foot, start, stop, float(higher[start:stop].max()))
            for start, stop in true_runs(hovers)
            if (stop - start) * clip.frame_time >= _LASTS
        ]
    return tuple(found)
