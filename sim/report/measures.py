"""The report's measures: pure functions of arrays."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import minimum_filter1d

from sim.report.derivatives import derivative
from spark.resample import values_at
from spark.summary import brief
from spark.transfer.breaks import MAX_SPEED

# The slope across a path is only told where the path is wider than this share of its length, and a
# slope at all where it leaves at most this share of the heights' standard deviation.
_MIN_WIDTH, _MAX_UNEXPLAINED = 0.3, 0.5
_BEGIN = 0.25  # [s] in which a T-pose that a converter put before a source ends


def floor_height(lowest: Float[np.ndarray, "T"]) -> float:
    """The floor's z [m]: the 5th percentile of the lowest sole point's height over a clip."""
    return float(np.percentile(lowest, 5))


def penetration_depth(heights: Float[np.ndarray, "T N"]) -> Float[np.ndarray, "T N"]:
    """How deep each point lies under the floor [m], from its height above the floor; 0 above."""
    return np.maximum(-heights, 0.0)


def floating(
    clearance: Float[np.ndarray, "T"],
    fall_error: Float[np.ndarray, "T"],
    height: float,
    free_fall: float,
) -> Bool[np.ndarray, "T"]:
    """Floating: nothing of the body is within `height` [m] of the floor, and yet it does not fall.

    `clearance` [m] is the height of the body's lowest point; `fall_error` [m/s²] is how far the
    vertical acceleration of the centre of mass is from gravity's, up to `free_fall` in free fall.
    """
    return (clearance > height) & (fall_error > free_fall)


def windowed_min(
    values: Float[np.ndarray, "T *n"], frame_time: float, window: float
) -> Float[np.ndarray, "T *n"]:
    """The least value from `window` seconds before each frame to as long after it.

    Between frames values are linear, so that the frame rate doesn't matter.
    """
    times = np.arange(len(values)) * frame_time
    least = minimum_filter1d(values, 2 * int(window / frame_time) + 1, axis=0, mode="nearest")
    for edge in (-window, window):
        least = np.minimum(least, values_at(values, (times + edge) / frame_time))
    return least


def horizontal_speed(
    points: Float[np.ndarray, "T P 3"], frame_time: float, window: float
) -> Float[np.ndarray, "T P"]:
    """Speed along the floor [m/s]."""
    return np.linalg.norm(derivative(points[..., :2], frame_time, 1, window), axis=-1)


@dataclass(frozen=True, eq=False)
class Drift:
    """How far the root strays from the source's path, which is scaled to the body.

    `distance` [m] is horizontal, frame by frame, with both paths starting at the same point. A
    source that leaps in its first `_BEGIN` starts after that: a T-pose elsewhere has no distance.
    `path_length` [m] is that of the scaled source; `heading` [rad] is the difference of headings,
    at most half a turn.
    """

    distance: Float[np.ndarray, "T"]
    path_length: float
    heading: Float[np.ndarray, "T"]

    __repr__ = brief


def root_drift(
    hips: Float[np.ndarray, "T 3"],
    heading: Float[np.ndarray, "T"],
    source_hips: Float[np.ndarray, "T 3"],
    source_heading: Float[np.ndarray, "T"],
    scale: float,
    frame_time: float,
) -> Drift:
    """Both motions at the same times; `scale` is how far the body goes for each metre of it."""
    steps = np.linalg.norm(np.diff(source_hips[: 1 + int(_BEGIN / frame_time)], axis=0), axis=-1)
    leaps = np.flatnonzero(steps > MAX_SPEED * frame_time)
    start = leaps[-1] + 1 if len(leaps) else 0
    path = (hips - hips[start])[:, :2]
    source_path = scale * (source_hips - source_hips[start])[:, :2]
    turned = heading - source_heading
    # A whole turn is none to see: a frame that faces back may leave one behind for good.
    turned = (turned + np.pi) % (2 * np.pi) - np.pi
    begun = np.arange(len(hips)) >= start
    return Drift(
        distance=begun * np.linalg.norm(path - source_path, axis=-1),
        path_length=float(np.linalg.norm(np.diff(source_path[start:], axis=0), axis=-1).sum()),
        heading=begun * turned,
    )


def distance_outside_hull(
    point: Float[np.ndarray, "T 2"],
    points: Float[np.ndarray, "T P 2"],
    mask: Bool[np.ndarray, "T P"],
) -> Float[np.ndarray, "T"]:
    """How far a place lies outside the convex hull of the points in use [m]; 0 inside.

    The distance to a convex set is the largest over all directions of how much further the place
    lies than the set; here over 72. Without points it is infinite.
    """
    angle = 2 * np.pi * np.arange(72) / 72
    directions = np.stack([np.cos(angle), np.sin(angle)])
    reach = np.where(mask[..., None], (points - point[:, None]) @ directions, -np.inf).max(axis=1)
    return np.maximum(-reach.min(axis=1), 0.0)


@dataclass(frozen=True)
class ContactMatch:
    """How a motion's foot contacts agree with the source's, over feet and frames, in [0, 1].

    None where there is nothing to be right about: no contact found, none in the source.
    """

    precision: float | None
    recall: float | None
    f1: float | None


def contact_match(
    contacts: Bool[np.ndarray, "T F"], source_contacts: Bool[np.ndarray, "T F"]
) -> ContactMatch:
    """Precision, recall and F1 of `contacts` where `source_contacts` is the truth."""
    right = float((contacts & source_contacts).sum())
    claimed, true = float(contacts.sum()), float(source_contacts.sum())
    return ContactMatch(
        right / claimed if claimed else None,
        right / true if true else None,
        2 * right / (claimed + true) if claimed + true else None,
    )


class Slope(NamedTuple):
    """A floor that slopes: how much higher it is [m] a metre further along X and Y, a place [m]
    that is as high as its mean, and the `rise` [m] between the lowest of the places and the
    highest."""

    gradient: Float[np.ndarray, "2"]
    middle: Float[np.ndarray, "2"]
    rise: float

    @property
    def angle(self) -> float:
        """How steep it is [rad]."""
        return float(np.arctan(np.linalg.norm(self.gradient)))


LEVEL = Slope(np.zeros(2), np.zeros(2), 0.0)


def fitted_slope(places: Float[np.ndarray, "N 3"]) -> Slope:
    """The slope of the plane of least squares through `places`, level across the path where the
    feet keep to a line."""
    if len(places) < 3:
        return LEVEL
    middle = places[:, :2].mean(axis=0)
    horizontal = places[:, :2] - middle
    heights = places[:, 2] - places[:, 2].mean()
    gradient, *_ = np.linalg.lstsq(horizontal, heights, rcond=_MIN_WIDTH)
    return Slope(gradient, middle, float(np.ptp(horizontal @ gradient)))


def floor_slope(places: Float[np.ndarray, "N 3"]) -> Slope:
    """The slope of the floor on which feet stood at `places`; level where a plane does not explain
    the heights much better than a level does."""
    slope, heights = fitted_slope(places), places[:, 2]
    if slope is LEVEL:
        return LEVEL
    over = heights - (places[:, :2] - slope.middle) @ slope.gradient
    return LEVEL if np.std(over) > _MAX_UNEXPLAINED * np.std(heights) else slope
