"""A body that hovers for a while where its source stands, lower than what counts as floating."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from sim.report.clip_metrics import ClipMetrics
from sim.report.contact_timing import Standing
from sim.report.thresholds import PLAUSIBILITY_V4
from spark.resample import values_at
from spark.runs import true_runs

# A body hovers whose lowest point keeps further from the floor than this [m, of an adult]: flesh
# under soles is no thicker, and recordings on robots keep 0.6 cm at most.
HOVERS = 0.02
_LASTS = 0.2  # [s]


class Hover(NamedTuple):
    """A body is up to `height` [m] higher above the floor than its source in the frames [start,
    stop)."""

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
    """Where a foot of the source stands, at the same `times` [s], and the body is higher than it by
    more than `HOVERS`; without what counts as floating. `scale` is the hip height over the
    source's."""
    theirs = scale * values_at(source.clearance, times / source.frame_time)
    higher = clip.clearance - np.maximum(theirs, 0.0)
    bound = HOVERS * clip.thresholds.floating / PLAUSIBILITY_V4.floating
    hovers = (higher > bound) & standing.theirs.any(axis=1) & ~clip.flags["floating"]
    return tuple(
        Hover(start, stop, float(higher[start:stop].max()))
        for start, stop in true_runs(hovers)
        if (stop - start) * clip.frame_time >= _LASTS
    )
