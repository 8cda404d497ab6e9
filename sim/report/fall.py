"""How fast a body falls that is in the air: gravity tells a wrong frame rate, or a wrong size."""

import numpy as np

from sim.report.clip_metrics import ClipMetrics
from sim.report.clip_poses import pose_clip
from sim.trajectory import Subject
from spark.constants import GRAVITY
from spark.runs import true_runs

# A flight is a jump's that lasts no longer [s], has so many frames, takes the centre of mass so far
# up or down [m, of an adult], and along a parabola that leaves so little of that: in 190 recordings
# of people those that jump fall at 8.7 to 10.2 m/s² then.
_LONGEST, _FRAMES, _LEAST_RISE, _MOST_LEFT = 1.5, 5, 0.03, 0.025
_OFF = 1.33  # times as hard as gravity has it, or as softly: more is named
_HANGS = 0.23  # of gravity: what is softer than at half the speed hangs, climbs or is carried


def fall_notes(subject: Subject, clip: ClipMetrics, whose: str) -> tuple[str, ...]:
    """A note where a motion, which is called `whose`, jumps and falls as nothing does on earth. A
    model's size is right."""
    fall = fall_of(subject, clip)
    if fall is None or 1 / _OFF < fall / GRAVITY < _OFF:
        return ()
    fps, hard = subject.motion.fps, fall / GRAVITY
    fast = np.sqrt(hard)
    pace = f"{_told(fast)} times too fast" if hard > 1 else f"{_told(1 / fast)} times too slow"
    size = f"{_told(hard)} times too large" if hard > 1 else f"{_told(1 / hard)} times too small"
    note = (
        f"in the air {whose} falls at {fall:.1f} m/s², where gravity has {GRAVITY:.1f}: it is "
        f"{pace} (at {fps / fast:.3g} fps, not {fps:.4g}, it would fall so)"
    )
    return (note if subject.body is not None else f"{note}, or {size}",)


def _told(times: float) -> str:
    return f"{times:.2g}" if times < 100 else f"{times:.0f}"


def fall_of(subject: Subject, clip: ClipMetrics) -> float | None:
    """How hard the body's mass falls in its jumps [m/s²], the median; None without any."""
    limits, step = clip.thresholds, clip.frame_time
    falls = []
    for start, stop in true_runs(clip.clearance > limits.floating):
        count = stop - start
        if start == 0 or stop == len(clip) or count < _FRAMES or count * step > _LONGEST:
            continue
        height = pose_clip(subject.picked(slice(start, stop))).mass.com[:, 2]
        times = step * np.arange(count)
        parabola = np.polynomial.Polynomial.fit(times, height, 2)
        rise = float(np.ptp(height))
        if (
            rise > limits.of_adult(_LEAST_RISE)
            and np.std(height - parabola(times)) < _MOST_LEFT * rise
        ):
            falls.append(-float(parabola.deriv(2)(0.0)))
    found = float(np.median(falls)) if falls else 0.0
    return found if found > _HANGS * GRAVITY else None
