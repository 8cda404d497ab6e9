"""The ground under a motion: a level floor, and what feet stand on above it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from sim.report.course import Course
from sim.report.treads import Treads
from spark.runs import true_runs

_REACH = 0.3  # hip heights around a foot's place to which what it stands on reaches
_BELOW = 0.01  # hip heights below its top at which a point is still on it, and not beside it
_SAME_PLACE, _SAME_HEIGHT = 0.1, 0.02  # hip heights: places that are one


@dataclass(frozen=True)
class Stand:
    """That a foot stands at height `z` [m, world] in the frames from `start` up to `stop`."""

    foot: str
    start: int
    stop: int
    z: float


@dataclass(frozen=True, eq=False)
class Ground:
    """The floor at `floor_z` [m, world], and what is above it: `tops` [m], around each of which it
    reaches as far as for a body with hips at `hip_height` [m], and when feet stand there."""

    floor_z: float
    tops: Float[np.ndarray, "K 3"]
    stands: tuple[Stand, ...] = ()
    hip_height: float = 0.0

    def picked(self, span: slice) -> "Ground":
        """In the frames of a slice."""
        shifted = [
            replace(each, start=max(each.start - span.start, 0), stop=each.stop - span.start)
            for each in self.stands
        ]
        return replace(self, stands=tuple(each for each in shifted if each.stop > 0))

    def heights(
        self, points: Float[np.ndarray, "T P 3"], feet: Sequence[str] = ()
    ) -> Float[np.ndarray, "T P"]:
        """How high [m] points are over the ground below them; the first ones, corners of `feet`,
        over what these stand on while they do."""
        out = points[..., 2] - self.floor_z
        for top in self.tops:
            away = points - top
            on = np.linalg.norm(away[..., :2], axis=-1) < _REACH * self.hip_height
            on &= away[..., 2] > -_BELOW * self.hip_height
            out = np.where(on, np.minimum(out, away[..., 2]), out)
        for each in self.stands:
            own = [k for k, foot in enumerate(feet) if foot == each.foot]
            out[each.start : each.stop, own] = points[each.start : each.stop, own, 2] - each.z
        return out


def level_ground(floor_z: float) -> Ground:
    """A floor and nothing else."""
    return Ground(floor_z, np.zeros((0, 3)))


def ground_of(
    course: Course, floor_z: float, treads: Treads, source: Course, scale: float
) -> Ground:
    """The ground under a motion whose feet should stand, over its floor, `scale` times as high as
    those of its source: where its own are while these do."""
    if treads.level:
        return level_ground(floor_z)
    rate, sides = source.motion.frame_time / course.motion.frame_time, _sides(course)
    stands, tops = [], np.zeros((0, 3))
    least = course.rig.hip_height * np.array([_SAME_PLACE, _SAME_HEIGHT])
    for k, sole in enumerate(source.rig.soles):
        path = course.feet[:, [side == sole.side for side in sides], :2]
        for start, stop in true_runs(treads.stands[:, k]):
            own = slice(round(start * rate), round(stop * rate))
            if not path[own].size:
                continue
            z = floor_z + scale * float(np.median(treads.ground[start:stop, k]))
            stands.append(Stand(f"{sole.side} foot", own.start, own.stop, z))
            top = np.array([*path[own].mean(axis=(0, 1)), z])
            away = np.stack([np.linalg.norm((tops - top)[:, :2], axis=1), abs(tops[:, 2] - z)], 1)
            if z > floor_z and not (away < least).all(axis=1).any():
                tops = np.vstack([tops, top])
    return Ground(floor_z, tops, tuple(stands), course.rig.hip_height)


def _sides(course: Course) -> list[str]:
    """The side of each of a course's feet."""
    roles = [course.rig.roles.roles[j] for j in course.rig.contact_joints]
    return ["" if role is None else role.side for role in roles]
