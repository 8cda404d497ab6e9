"""Feet that slide where the source's stand, however slowly: what no frame shows, a viewer sees."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from sim.report.clip_metrics import ClipMetrics
from sim.report.contact_timing import Standing
from sim.report.course import Course
from spark.resample import values_at
from spark.runs import true_runs

# [m, of an adult] further than the source's: of 70 results of ours, on robots and characters, 4
# have a foot that goes so far and doesn't skate. They crawl.
_LEAST = 0.03
_ENDS = 0.1  # of its way that a foot may creep before and after
_ANGLES = np.pi * np.arange(36) / 36
_DIRECTIONS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)])


class Slide(NamedTuple):
    """A foot goes `distance` [m] further than the source's in the frames [start, stop)."""

    foot: str
    start: int
    stop: int
    distance: float


def slides_of(
    course: Course,
    source: Course,
    clip: ClipMetrics,
    standing: Standing,
    times: Float[np.ndarray, "T"],
    scale: float,
) -> tuple[Slide, ...]:
    """Of the feet that are low while the source's stand, at the same `times` [s]; without those
    that skate.

    How far a foot goes is how far the point of its sole does that goes least: feet roll from heel
    to toe. `scale` is the hip height over the source's.
    """
    limits, found = clip.thresholds, list[Slide]()
    least = limits.of_adult(_LEAST)
    at = times / source.motion.frame_time
    for k, foot in enumerate(standing.names):
        own, theirs = ([name == foot for name in each.corner_feet] for each in (course, source))
        low = clip.sole_heights[:, clip.feet.index(foot)] < limits.stand_height
        skates = np.any(clip.corner_skates[:, own], axis=1)
        for start, stop in true_runs(standing.theirs[:, k] & low):
            if skates[start:stop].any():
                continue
            moved, first, last = _moved(course.corners[start:stop, own])
            usual, *_ = _moved(values_at(source.corners[:, theirs], at[start:stop]))
            if (distance := moved - scale * usual) > least:
                found.append(Slide(foot, start + first, start + last + 1, distance))
    return tuple(found)


def _moved(points: Float[np.ndarray, "T C 2"]) -> tuple[float, int, int]:
    """The longest way [m] of the point that moves least, and the frames between which it goes most
    of it."""
    along = points @ _DIRECTIONS
    ways = np.ptp(along, axis=0)
    point = int(ways.max(axis=1).argmin())
    direction = int(ways[point].argmax())
    line, way = along[:, point, direction], float(ways[point, direction])
    first, last = sorted((int(line.argmin()), int(line.argmax())))
    gone = np.abs(line[first : last + 1] - line[first])
    begins = int(np.flatnonzero(gone <= _ENDS * way)[-1])
    arrives = begins + int(np.flatnonzero(gone[begins:] >= (1 - _ENDS) * way)[0])
    return way, first + begins, first + arrives
