"""Whether a motion lasts as long as its source, and at which frame rate it would."""

from spark.motion import Motion

# Frame rates that files have [fps], and by which share one may be missed: a frame in 100.
_RATES = (
    *(8.0, 10.0, 12.0, 12.5, 15.0, 20.0, 24.0, 25.0, 30.0, 48.0, 50.0, 60.0),
    *(72.0, 90.0, 100.0, 120.0, 144.0, 150.0, 180.0, 200.0, 240.0),
)
_RATE_LEEWAY = 0.01


def pace_notes(motion: Motion, source: Motion) -> tuple[str, ...]:
    """A note where the motion does not last as long as its source."""
    difference = abs(source.duration - motion.duration)
    if difference <= _same_duration(motion):
        return ()
    note = (
        f"the source's duration differs by {difference:.1f} s: it lasts {source.duration:.4g} s, "
        f"the motion {motion.duration:.4g} s, and frames may not match. "
    )
    if (rate := other_rate(motion, source)) is not None:
        return (f"{note}Is its rate {rate:g} fps, and not {motion.fps:.4g}?",)
    return (
        f"{note}Is it another motion? If it was made from a part of the source, give that part: "
        "`clip.part(start, end)`",
    )


def other_rate(motion: Motion, source: Motion) -> float | None:
    """The frame rate at which the motion lasts as long as its source, if files have that: a CSV
    that is read at another rate than its own runs too fast or too slowly, and nothing else shows
    it. None where it lasts as long anyway."""
    if source.duration <= 0 or abs(source.duration - motion.duration) <= _same_duration(motion):
        return None
    rate = (len(motion) - 1) / source.duration
    nearest = min(_RATES, key=lambda known: abs(rate - known))
    return nearest if abs(rate - nearest) < _RATE_LEEWAY * nearest else None


def _same_duration(motion: Motion) -> float:
    return max(0.1, 2 * motion.frame_time)
