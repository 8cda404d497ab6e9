"""Feet in swing: how high they pass over the floor, beside the source's."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from sim.report.clip_metrics import ClipMetrics
from spark.resample import values_at
from spark.summary import brief


@dataclass(frozen=True, eq=False)
class Swing:
    """Where the source's feet swing: `height` [m] is the median of the motion's lowest sole corner
    there, `source_height` that of the source's, scaled by the hip heights' ratio.

    `deficit[t, f]` [m] is how much lower than the scaled source's each of `feet` passes; nan where
    the source's doesn't swing. `seconds` is the time of swing, all feet together.
    """

    feet: tuple[str, ...]
    height: float
    source_height: float
    seconds: float
    deficit: Float[np.ndarray, "T F"]

    __repr__ = brief

    @property
    def clearance(self) -> float:
        """1 where feet clear the floor as the source's do for their size; 0 where they drag."""
        return self.height / self.source_height


def swing_of(
    clip: ClipMetrics, source: ClipMetrics, times: Float[np.ndarray, "T"], scale: float
) -> Swing | None:
    """The swings of the feet that both have; None where the source's hardly swing.

    A foot of the source swings where the middle of its sole is fast and all of it above the floor.
    `scale` is the hip height over the source's.
    """
    at, limits = times / source.frame_time, source.thresholds
    feet = tuple(foot for foot in clip.feet if foot in source.feet)
    own, theirs = ([side.feet.index(foot) for foot in feet] for side in (clip, source))
    lowest = values_at(source.sole_heights[:, theirs], at)
    swings = (values_at(source.sole_speeds[:, theirs], at) > limits.swing_speed) & (
        lowest > limits.swing_height
    )
    seconds = float(swings.sum()) * clip.frame_time
    if seconds < limits.swing_time:
        return None
    heights = clip.sole_heights[:, own]
    return Swing(
        feet=feet,
        height=max(float(np.median(heights[swings])), 0.0),
        source_height=scale * float(np.median(lowest[swings])),
        seconds=seconds,
        deficit=np.where(swings, scale * lowest - heights, np.nan),
    )
