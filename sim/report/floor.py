"""The floor of a motion by itself: where its feet stand.

The lowest points of soles alone are none. A toe that dips at each step is lower than all feet that
stand; and where the vertical of a recording is off by a degree, its floor is higher at one end.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float

from sim.report.clip_metrics import ClipMetrics
from sim.report.course import Course
from sim.report.measures import LEVEL, Slope, fitted_slope, floor_height
from sim.report.thresholds import HUMAN_HIP_HEIGHT, PLAUSIBILITY, Thresholds
from spark.rig.contacts import ADULT_HEIGHT, PLANTED_SPEED, climbing_speeds, speeds
from spark.transfer.ground import Ground, level_ground

# [rad] Recordings' verticals are off by a degree or so: feet on a steeper slope walk up a ramp.
MAX_SLOPE = np.radians(2.5)
_MOST, _FINE = 0.08, 0.001  # [m, of an adult] by which toes dip below those that stand, at most
_LEAST_TIME = 0.5  # [s] that feet stand, to tell a floor by them
# Floors are as good that explain this share of what the best does: the lowest points keep theirs
# unless it is clearly worse, and of the better ones the share may differ by a frame or two.
_CLEARLY, _ABOUT = 0.95, 0.98


def own_floor(course: Course) -> Ground:
    """The floor under a motion of which nothing else is known; a model's is its simulator's.

    It is at the 5th percentile of the lowest sole point, or higher by up to `_MOST` where that
    explains clearly more of the frames in which a foot stands, so that it neither sinks nor floats.
    Where a slope of a degree or two explains clearly more of them than a level, it is that slope.
    """
    if course.subject.body is not None:
        return level_ground(0.0)
    level = _floor(course, LEVEL)
    slope = fitted_slope(course.lowest[_still(course)])
    if slope.angle > MAX_SLOPE:
        return level
    sloping = _floor(course, slope)
    better = _CLEARLY * explained(course, sloping) > explained(course, level)
    return sloping if better else level


def _floor(course: Course, slope: Slope) -> Ground:
    over = course.lowest[:, 2] - (course.lowest[:, :2] - slope.middle) @ slope.gradient
    (along_x, along_y), (x, y) = slope.gradient.tolist(), slope.middle.tolist()
    level = level_ground(_height(over, course))
    return replace(level, gradient=(along_x, along_y), middle=(x, y))


def copied_floor(
    course: Course, floor_z: float, source: Course, source_floor_z: float, own: Ground, scale: float
) -> Ground | None:
    """The floor that a motion copies from its source's `own` one, scaled, from where both begin.

    None where a level floor at `floor_z`, where the source's lowest points at `source_floor_z` come
    to lie, explains as many of the frames in which a foot stands: feet that hovered were let down
    to it. That of a model is level, too.
    """
    if course.subject.body is not None:
        return None
    level = level_ground(floor_z)
    higher = scale * float(_over(own, source.hips[:1], source_floor_z)[0])
    x, y = course.hips[0, :2].tolist()
    copied = replace(level, floor_z=floor_z + higher, gradient=own.gradient, middle=(x, y))
    return copied if explained(course, copied) > explained(course, level) else None


def over_level(clip: ClipMetrics, course: Course, own: Ground, floor_z: float) -> ClipMetrics:
    """A clip with its soles' heights over a level floor instead of its own."""
    higher = _over(own, course.hips, floor_z)
    return replace(clip, sole_heights=clip.sole_heights + higher[:, None])


def _over(ground: Ground, hips: Float[np.ndarray, "T 3"], floor_z: float) -> Float[np.ndarray, "T"]:
    """How high [m] a floor is below the hips over a level one."""
    return np.asarray(hips[:, 2] - ground.heights(hips[:, None])[:, 0] - floor_z)


def on_floor(ground: Ground, floor: Ground) -> Ground:
    """What is above a floor, over another one."""
    return replace(ground, floor_z=floor.floor_z, gradient=floor.gradient, middle=floor.middle)


def standing_places(course: Course) -> Float[np.ndarray, "N 3"]:
    """The lowest sole points while a foot stands, however high it is: on a slope those that stand
    low would be taken for all that stand."""
    return course.lowest[_slow(course, speeds).any(axis=1)]


def _height(lowest: Float[np.ndarray, "T"], course: Course) -> float:
    """The floor's height [m] under soles whose lowest points are so high."""
    limits, size = _limits(course), course.rig.hip_height / HUMAN_HIP_HEIGHT
    least, heights = floor_height(lowest), np.sort(lowest[_still(course)])
    if len(heights) * course.motion.frame_time < _LEAST_TIME:
        return least
    floors = least + size * np.arange(0.0, _MOST, _FINE)
    explained = np.searchsorted(heights, floors + limits.floating, "right")
    explained -= np.searchsorted(heights, floors - limits.penetration, "left")
    if explained[0] >= _CLEARLY * explained.max():
        return least
    best = floors[explained.argmax()]
    stand = heights[(heights >= best - limits.penetration) & (heights <= best + limits.floating)]
    good = floors[explained >= _ABOUT * explained.max()]
    return float(good[np.abs(good - floor_height(stand)).argmin()])


def explained(course: Course, ground: Ground) -> int:
    """In how many of the frames in which a foot is still it stands on some ground."""
    heights, limits = ground.heights(course.lowest[_still(course), None])[:, 0], _limits(course)
    return int(((heights >= -limits.penetration) & (heights <= limits.floating)).sum())


def _limits(course: Course) -> Thresholds:
    return PLAUSIBILITY.scaled(course.rig.hip_height)


def still_feet(course: Course) -> Bool[np.ndarray, "T F"]:
    """Which feet are still, however high."""
    still: Bool[np.ndarray, "T F"] = _slow(course, speeds) & _slow(course, climbing_speeds)
    return still


def _still(course: Course) -> Bool[np.ndarray, "T"]:
    """The frames in which a foot is still, however high."""
    return np.asarray(still_feet(course).any(axis=1))


def _slow(
    course: Course, pace: Callable[[Float[np.ndarray, "T F 3"], float], Float[np.ndarray, "T F"]]
) -> Bool[np.ndarray, "T F"]:
    """Which feet are slow by a measure of their pace [m/s]."""
    limit = PLANTED_SPEED * course.rig.standing_height / ADULT_HEIGHT
    slow: Bool[np.ndarray, "T F"] = pace(course.feet, course.motion.frame_time) < limit
    return slow
