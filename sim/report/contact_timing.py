"""When feet stand, beside the source's; and where they stand at other times, why that may be."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from sim.report.clip_metrics import ClipMetrics
from sim.report.measures import ContactMatch, contact_match
from spark.resample import values_at
from spark.runs import true_runs

# F1 below which contacts are poor: of 120 results of ours with a pose like the source's, none that
# has another pose is below `_POOR`, and none at all below `_VERY_POOR`.
_POOR, _VERY_POOR = 0.75, 0.45
_OTHER_POSE = np.radians(9)  # in the mean over the parts: results that follow have up to 8 degrees
# Exchanged or shifted, contacts fit far better if they fit so well, and so much better. A shift
# shows in the poses, too: they are then this many times as far from the source's.
_FITS, _BETTER, _POSES_FIT = 0.8, 0.2, 0.6
_LEAST_LAG, _LONGEST_LAG = 0.1, 1.0  # [s]
_MERGE_GAP = 0.1  # [s]


@dataclass(frozen=True, eq=False)
class Standing:
    """When the feet that both bodies have stand, `own` and the source's (`theirs`) at the same
    times; `names` are the feet."""

    names: tuple[str, ...]
    own: Bool[np.ndarray, "T F"]
    theirs: Bool[np.ndarray, "T F"]
    frame_time: float

    @property
    def match(self) -> ContactMatch:
        """How the two agree."""
        return contact_match(self.own, self.theirs)

    @property
    def exchanged_f1(self) -> float:
        """The F1 score with the source's left foot for its right one; 0 of a single foot."""
        return _f1(self.own, self.theirs[:, ::-1]) if len(self.names) == 2 else 0.0

    def best_lag(self) -> tuple[int, float]:
        """By how many frames later than the source the motion fits best, and the F1 score then."""
        longest = min(int(_LONGEST_LAG / self.frame_time), len(self.own) // 3)
        lags = sorted(range(-longest, longest + 1), key=abs)
        return max(((lag, self._lagged(lag)) for lag in lags), key=lambda found: found[1])

    def _lagged(self, lag: int) -> float:
        count = len(self.own) - abs(lag)
        own, theirs = max(lag, 0), max(-lag, 0)
        return _f1(self.own[own : own + count], self.theirs[theirs : theirs + count])


@dataclass(frozen=True)
class Discord:
    """Feet stand at other times than the source's: longest in the frames [start, stop).

    `words` say so, and what it looks like: mirrored, late, or another motion, if it has
    an `other_pose`.
    """

    match: ContactMatch
    start: int
    stop: int
    words: str
    other_pose: bool


def standing_beside(
    clip: ClipMetrics, source: ClipMetrics, times: Float[np.ndarray, "T"]
) -> Standing:
    """Each foot stands on whatever part of its own sole touches; the clip's frames lie at `times`
    [s] of the source."""
    feet = tuple(foot for foot in clip.standing if foot in source.standing)
    theirs = np.stack([source.standing[foot] for foot in feet], axis=1).astype(float)
    return Standing(
        feet,
        np.stack([clip.standing[foot] for foot in feet], axis=1),
        values_at(theirs, times / source.frame_time) > 0.5,
        clip.frame_time,
    )


def discord_of(
    standing: Standing,
    pose: float | None,
    pose_at_lag: Callable[[float], float | None],
    question: str,
) -> Discord | None:
    """None where the feet stand when the source's do, more or less.

    `pose` [rad] is the mean angle between the parts of both; `pose_at_lag` gives that if the source
    is taken so much earlier [s]. `question` is asked where neither side nor time explains it.
    """
    match = standing.match
    other_pose = pose is None or bool(pose > _OTHER_POSE)
    if match.f1 is None or match.f1 >= (_POOR if other_pose else _VERY_POOR):
        return None
    apart = np.any(standing.own != standing.theirs, axis=1)
    runs = true_runs(apart, int(_MERGE_GAP / standing.frame_time))
    start, stop = max(runs, key=lambda run: run[1] - run[0])
    cause = ""
    if other_pose:
        cause = _cause(standing, match.f1, pose, pose_at_lag) or f": {question}"
    words = f"feet stand at other times than the source's (F1 {match.f1:.2f}){cause}"
    return Discord(match, start, stop, words, other_pose)


def _cause(
    standing: Standing,
    f1: float,
    pose: float | None,
    pose_at_lag: Callable[[float], float | None],
) -> str:
    def fits(score: float) -> bool:
        return score >= max(_FITS, f1 + _BETTER)

    if fits(standing.exchanged_f1):
        score = standing.exchanged_f1
        return f", and when its other foot does (F1 {score:.2f}): is it mirrored?"
    frames, score = standing.best_lag()
    lag = frames * standing.frame_time
    if fits(score) and abs(lag) >= _LEAST_LAG:
        there = pose_at_lag(lag)
        if pose is None or there is None or there < _POSES_FIT * pose:
            word = "late" if lag > 0 else "early"
            return f": the motion is {abs(lag):.2f} s {word} (F1 {score:.2f} if shifted)"
    return ""


def _f1(one: Bool[np.ndarray, "T F"], other: Bool[np.ndarray, "T F"]) -> float:
    return contact_match(one, other).f1 or 0.0
