"""Limbs that are thrown about: how hard their ends are accelerated, beside the source's."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from sim.report.clip_metrics import ClipMetrics
from sim.report.measures import windowed_min
from spark.resample import values_at
from spark.summary import brief


@dataclass(frozen=True, eq=False)
class Limbs:
    """The limbs that a motion and its source both have, by name.

    `peaks` and `source_peaks` [m/s²] are the 99th percentiles over the frames of the acceleration
    of each limb's end, the source's times its part of `scales`: the ratio of the hip heights, or of
    the limb's lengths where that is more. Less than `least` [m/s²] counts as that: beside a source
    that stands still, any move would be many times as hard.
    `excess[t, k]` is the acceleration over the source's peak, or over what it reaches near that
    time, or over that of the own base, whichever is most; a limb is thrown where it is above
    `bound`.
    """

    names: tuple[str, ...]
    scales: Float[np.ndarray, "L"]
    peaks: Float[np.ndarray, "L"]
    source_peaks: Float[np.ndarray, "L"]
    least: float
    excess: Float[np.ndarray, "T L"]
    bound: float

    __repr__ = brief

    @property
    def ratios(self) -> Float[np.ndarray, "L"]:
        """Each limb's acceleration over the source's."""
        return np.maximum(self.peaks, self.least) / np.maximum(self.source_peaks, self.least)

    @property
    def worst(self) -> int:
        """The limb that is accelerated hardest for what the source's is."""
        return int(self.ratios.argmax())

    @property
    def ratio(self) -> float:
        """1 where no limb is accelerated harder than the source's for its size."""
        return float(self.ratios[self.worst])

    @property
    def worst_frame(self) -> int:
        """The frame in which the worst limb exceeds the source's most."""
        return int(self.excess[:, self.worst].argmax())

    @property
    def thrown(self) -> Bool[np.ndarray, "T L"]:
        """The frames in which each limb is."""
        return self.excess > self.bound


def limbs_of(
    clip: ClipMetrics, source: ClipMetrics, times: Float[np.ndarray, "T"], scale: float
) -> Limbs | None:
    """The limbs of both, the source at the same `times` [s]; None where they share none.

    `scale` is the hip height over the source's.
    """
    names = tuple(name for name in clip.limb_names if name in source.limb_names)
    if not names:
        return None
    limits, step = clip.thresholds, clip.frame_time
    own, theirs = ([side.limb_names.index(name) for name in names] for side in (clip, source))
    found = clip.limb_acceleration[:, own]
    scales = np.maximum(scale, clip.limb_lengths[own] / source.limb_lengths[theirs])
    source_peaks = scales * source.limb_peaks[theirs]
    # A foot may land a little earlier or later than the source's.
    there = scales * values_at(source.limb_acceleration[:, theirs], times / source.frame_time)
    near = -windowed_min(-there, step, 2 * limits.window)
    usual = np.maximum(near, np.maximum(source_peaks, limits.limb_least))
    # What is thrown with the whole body is the base's throw.
    usual = np.maximum(usual, clip.base_acceleration[:, None])
    return Limbs(
        names=names,
        scales=scales,
        peaks=clip.limb_peaks[own],
        source_peaks=source_peaks,
        least=limits.limb_least,
        excess=found / usual,
        bound=limits.limb_throw,
    )
