"""Several moving bodies on one floor, side by side, in one MuJoCo model."""

from dataclasses import dataclass
from functools import cached_property

import mujoco
import numpy as np
from jaxtyping import Float, Int

from sim.view.skin import WornSkin
from spark.rotation import quat_rotate

# A figure is lost to the camera once its root is faster than this [m/s], no man being so; further
# from two standing heights over the floor than so many of them; or further [standing heights] from
# where the figure that leads has gone.
_LOST_SPEED, _LOST_HEIGHT, _LOST_DISTANCE = 15.0, 3.0, 5.0
_FLOWN = 10.0  # standing heights


@dataclass(frozen=True, eq=False)
class Placement:
    """Where a figure stands in the scene: its own world, scaled by `scale`, rotated about Z by
    `turn`, then moved by `translation` [m].

    Of the scene's model it has the coordinates `columns` and the bodies `bodies`, its root first;
    `own` are the coordinates of its subject's model that these are.
    Its standing `height` in the scene is in metres; `lane` [m] is where it stands beside the
    others, along Y. `ahead` is where it faces, in its root body's axes. `ground` is the body of
    what it stands on, where there is any.
    """

    label: str
    ghost: bool
    turn: Float[np.ndarray, "4"]
    translation: Float[np.ndarray, "3"]
    scale: float
    columns: slice
    own: Int[np.ndarray, "n"]
    bodies: range
    height: float
    lane: float
    ahead: Float[np.ndarray, "3"]
    skin: WornSkin | None = None
    ground: range = range(0)

    def to_scene(self, points: Float[np.ndarray, "*N 3"]) -> Float[np.ndarray, "*N 3"]:
        """Points of the figure's own world in the scene's."""
        return quat_rotate(self.turn, self.scale * points) + self.translation


@dataclass(frozen=True, eq=False)
class Scene:
    """One model of all figures and their coordinates over common frames; floor at z = 0."""

    model: mujoco.MjModel
    qpos: Float[np.ndarray, "T nq"]
    frame_time: float
    placements: tuple[Placement, ...]

    @property
    def height(self) -> float:
        """The standing height [m] of the tallest figure."""
        return max(placement.height for placement in self.placements)

    @cached_property
    def centers(self) -> Float[np.ndarray, "T 3"]:
        """The path of the figures' middle, for a camera to follow."""
        paths = np.stack(self.kept_paths)
        centers = (paths.min(0) + paths.max(0)) / 2
        centers[:, 2] = 0.48 * self.height
        return centers

    def path(self, placement: Placement) -> Float[np.ndarray, "T 3"]:
        """Where a figure's root is."""
        return self.qpos[:, placement.columns][:, :3]

    @cached_property
    def kept_paths(self) -> tuple[Float[np.ndarray, "T 3"], ...]:
        """Where each figure's root is, for as long as a camera can keep it in its picture: one that
        flies off, as a simulation that diverges does, rests where it was before."""
        return tuple(self.kept_path(placement) for placement in self.placements)

    def kept_path(self, placement: Placement) -> Float[np.ndarray, "T 3"]:
        """That of one figure."""
        path, lost = self.path(placement).copy(), self.lost_from(placement)
        path[lost:] = path[max(lost - 1, 0)]
        return path

    def lost_from(self, placement: Placement) -> int:
        """From which frame on a figure has flown off; the number of frames where it never has."""
        path, height = self.path(placement), placement.height
        jumps = np.zeros(len(path))
        jumps[1:] = np.linalg.norm(np.diff(path, axis=0), axis=1) / self.frame_time
        start = np.array([0.0, placement.lane, 0.0])
        way = self.path(self._reference) - [0.0, self._reference.lane, 0.0]
        apart = np.linalg.norm((path - start - way)[:, :2], axis=1)
        lost = (
            (jumps > _LOST_SPEED)
            | (np.abs(path[:, 2] - 2 * height) > _LOST_HEIGHT * height)
            | (apart > _LOST_DISTANCE * max(height, self._reference.height))
        )
        return int(lost.argmax()) if lost.any() else len(path)

    def in_reach(
        self, placement: Placement, points: Float[np.ndarray, "T *n 3"]
    ) -> Float[np.ndarray, "T *n 3"]:
        """Points of a figure; once it has flown off, no further than `_FLOWN` from where it was
        lost: 16-bit integers hold no more."""
        kept = self.kept_path(placement)
        kept = kept.reshape(len(kept), *[1] * (points.ndim - 2), 3)
        most = _FLOWN * self.height
        return kept + np.clip(points - kept, -most, most)

    @cached_property
    def _reference(self) -> Placement:
        """Who is followed where the figures part: the target of a simulation, or the first."""
        return next((p for p in self.placements if p.ghost), self.placements[0])
