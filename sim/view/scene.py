"""Several moving bodies on one floor, side by side, in one MuJoCo model."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import mujoco
import numpy as np
from jaxtyping import Float, Int

from sim.body.compiling import compiled
from sim.trajectory import Subject, coordinates_at, model_trajectory
from sim.view.display import add_display, body_names
from sim.view.skin import WornSkin, add_skin, worn_by
from sim.view.text import shortened
from sim.view.world import add_pillars, empty_world
from spark.errors import SkeletonError
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.feet import sole_positions
from spark.rig.rig import Rig
from spark.rotation import quat_about, quat_conj, quat_mul, quat_rotate
from spark.skin import Skin

# A figure is lost to the camera once its root is faster than this [m/s], no man being so; further
# from two standing heights over the floor than so many of them; or further [standing heights] from
# where the figure that leads has gone.
_LOST_SPEED, _LOST_HEIGHT, _LOST_DISTANCE = 15.0, 3.0, 5.0
_FLOWN = 10.0  # standing heights
_SAME_FPS = 1.005  # of frames a second: a file's 0.016666 s means 60, and 0.004166 s means 240
_HEAD = 0.12  # of the standing height: from the head's joint to the crown
_PILLAR = 0.09  # of the standing height: the radius of what a foot stands on above the floor
_SPACING = 0.8  # of two neighbours' mean standing height, between their roots: arms do not meet


@dataclass(frozen=True, eq=False)
class Figure:
    """A moving body to show, with what to call it and where its floor is [m].

    Where the subject has no model, one is built from its rig. A `ghost` is seen through, and stands
    where the figure before it stands: in the same world, or, where it is `aligned`, so that both
    begin in one place. With a `height` [m], the body and its way are scaled to stand as tall. A
    `skin` on the rig's joints is shown instead of the body that is built from the rig. It stands
    on pillars up to `tops` [m] in its own world.
    """

    subject: Subject
    label: str
    floor_z: float = 0.0
    ghost: bool = False
    aligned: bool = False
    height: float | None = None
    skin: Skin | None = None
    tops: Float[np.ndarray, "K 3"] = field(default_factory=lambda: np.zeros((0, 3)))

    @property
    def motion(self) -> Motion:
        return self.subject.motion

    @property
    def rig(self) -> Rig:
        return self.subject.rig

    @property
    def scale(self) -> float:
        """How much larger it is shown than it is."""
        return 1.0 if self.height is None else self.height / self.own_height

    @property
    def own_height(self) -> float:
        """The height [m] of its crown over its soles in the T-pose; where it has no head, that of a
        human with its legs."""
        rig = self.rig
        heads = [j for j, role in enumerate(rig.roles.roles) if role is not None and role == "head"]
        if not heads or not rig.soles:
            return rig.standing_height
        heights = rig.tpose_positions[:, 2]
        feet = [sole_positions(s, rig.tpose_positions, rig.tpose)[:, 2].min() for s in rig.soles]
        return float(heights[heads].max() - min(feet)) + _HEAD * rig.standing_height


@dataclass(frozen=True, eq=False)
class Placement:
    """Where a figure stands in the scene: its own world, scaled by `scale`, rotated about Z by
    `turn`, then moved by `translation` [m].

    Of the scene's model it has the coordinates `columns` and the bodies `bodies`, its root first;
    `own` are the coordinates of its subject's model that these are.
    Its standing `height` in the scene is in metres; `lane` [m] is where it stands beside the
    others, along Y. `ahead` is where it faces, in its root body's axes. `pillars` is the body of
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
    pillars: range = range(0)

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
        self,
        placement: Placement,
        points: Float[np.ndarray, "N *n 3"],
        frames: slice | Int[np.ndarray, "N"] = slice(None),
    ) -> Float[np.ndarray, "N *n 3"]:
        """Points of a figure in some frames; once it has flown off, no further than `_FLOWN` from
        where it was lost: 16-bit integers hold no more."""
        kept = self.kept_path(placement)[frames]
        kept = kept.reshape(len(kept), *[1] * (points.ndim - 2), 3)
        most = _FLOWN * self.height
        return kept + np.clip(points - kept, -most, most)

    @cached_property
    def _reference(self) -> Placement:
        """Who is followed where the figures part: the target of a simulation, or the first."""
        return next((p for p in self.placements if p.ghost), self.placements[0])


def build_scene(figures: Sequence[Figure], *, max_fps: float = 60.0, blend: bool = False) -> Scene:
    """The scene of some figures that move together, left to right as they are given.

    All are turned by one angle, so that the first faces +X at first. Frames are those of the first
    figure, thinned to at most `max_fps`; to `blend`, as many as that allows are made between them.
    The others are read at the same times and rest in their last frame when theirs is over.
    """
    if not figures:
        raise SkeletonError("nothing to show: expected at least one motion")
    world = empty_world()
    first = figures[0].motion
    step = thinned(first.fps, max_fps)
    between = max(1, int(max_fps / first.fps * _SAME_FPS)) if blend else 1
    frame_time = first.frame_time * step / between
    longest = max(figure.motion.duration for figure in figures)
    times = np.arange(int(np.floor(longest / frame_time + 1e-6)) + 1) * frame_time
    heights = [figure.rig.standing_height * figure.scale for figure in figures]
    lanes = _lanes(figures, heights)
    turn = _turn_to_front(figures[0])
    coordinates: list[Float[np.ndarray, "T n"]] = []
    placements: list[Placement] = []
    column = 0
    for k, figure in enumerate(figures):
        body = figure.subject.body or model_trajectory(figure.rig, figure.motion.frames(0, 1))
        first_body = len(list(world.bodies))
        worn = None
        if figure.skin is not None and not figure.ghost:
            names = body_names(body.model, figure.rig, f"{k}_")
            worn = worn_by(figure.skin, figure.rig, names, scale=figure.scale)
        columns = add_display(
            world, body, f"{k}_", ghost=figure.ghost, scale=figure.scale, bare=worn is not None
        )
        if worn is not None:
            add_skin(world, worn, f"{k}_")
        qpos = _finite(coordinates_at(figure.subject, body.model, times, columns))
        qpos[:, :3] *= figure.scale
        if figure.ghost and placements and not figure.aligned:
            translation = placements[-1].translation
        else:
            start = quat_rotate(turn, qpos[0, :3])
            translation = np.array([-start[0], lanes[k] - start[1], -figure.scale * figure.floor_z])
        qpos[:, :3] = quat_rotate(turn, qpos[:, :3]) + translation
        qpos[:, 3:7] = quat_mul(turn, qpos[:, 3:7])
        coordinates.append(qpos)
        following = column + len(columns)
        bodies = range(first_body, len(list(world.bodies)))
        ahead = quat_rotate(turn, _ahead(figure))
        placement = Placement(
            label=shortened(figure.label),
            ghost=figure.ghost,
            turn=turn,
            translation=translation,
            scale=figure.scale,
            columns=slice(column, following),
            own=columns,
            bodies=bodies,
            height=heights[k],
            lane=float(lanes[k]),
            ahead=quat_rotate(quat_conj(qpos[0, 3:7]), ahead),
            skin=worn,
        )
        if len(figure.tops) and not figure.ghost:
            add_pillars(world, placement.to_scene(figure.tops), _PILLAR * heights[k])
            placement = replace(placement, pillars=range(bodies.stop, bodies.stop + 1))
        placements.append(placement)
        column = following
    qpos = np.concatenate(coordinates, axis=1)
    return Scene(compiled(world), qpos, frame_time, tuple(placements))


def thinned(fps: float, most: float) -> int:
    """Of how many frames one is shown, so that there are at most about `most` a second."""
    return max(1, int(np.ceil(fps / most / _SAME_FPS)))


def _finite(qpos: Float[np.ndarray, "T n"]) -> Float[np.ndarray, "T n"]:
    """Frames that are no numbers show the last one that was."""
    bad = ~np.isfinite(qpos).all(axis=1)
    if not bad.any():
        return qpos
    last = np.maximum.accumulate(np.where(bad, 0, np.arange(len(qpos))))
    return np.nan_to_num(qpos[last], posinf=0.0, neginf=0.0)


def _lanes(figures: Sequence[Figure], heights: Sequence[float]) -> Float[np.ndarray, "K"]:
    """Where each figure stands, from left to right as the camera sees them; the middle is 0."""
    lanes = np.zeros(len(figures))
    for k in range(1, len(figures)):
        gap = 0.0 if figures[k].ghost else _SPACING * (heights[k - 1] + heights[k]) / 2
        lanes[k] = lanes[k - 1] + gap
    return lanes - lanes[-1] / 2


def _turn_to_front(figure: Figure) -> Float[np.ndarray, "4"]:
    """The turn about Z after which the figure faces +X in its first frame."""
    ahead = _ahead(figure)
    if np.hypot(ahead[0], ahead[1]) < 0.3:  # lies: where it looks says nothing
        return np.array([1.0, 0, 0, 0])
    return quat_about("z", np.array(-np.arctan2(ahead[1], ahead[0])))


def _ahead(figure: Figure) -> Float[np.ndarray, "3"]:
    """Where the figure's pelvis faces in its first frame, in its own world."""
    rig = figure.rig
    pelvis = forward(figure.motion.frames(0, 1))[1][0, rig.root_joint]
    return quat_rotate(
        quat_mul(pelvis, quat_conj(rig.tpose[rig.root_joint])), np.array([1.0, 0, 0])
    )
