"""Figures are put on one stage: side by side, turned to the front, at common times."""

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np
from jaxtyping import Float, Int

from sim.body.compiling import compiled
from sim.trajectory import ModelTrajectory, coordinates_at, model_trajectory
from sim.view.display import add_display, body_names
from sim.view.figure import Figure
from sim.view.scene import Placement, Scene
from sim.view.skin import WornSkin, add_skin, worn_by
from sim.view.text import shortened
from sim.view.world import add_pillars, add_terrain, empty_world
from spark.errors import SkeletonError
from spark.rotation import quat_about, quat_conj, quat_mul, quat_rotate

_SAME_FPS = 1.005  # of frames a second: a file's 0.016666 s means 60, and 0.004166 s means 240
_PILLAR = 0.09  # of the standing height: the radius of what a foot stands on above the floor
_SPACING = 0.8  # of two neighbours' mean standing height, between their roots: arms do not meet
_WIDEST = 3.0  # of that height, between what is stated to be under them: hills go on and on


def build_scene(figures: Sequence[Figure], *, max_fps: float = 60.0, blend: bool = False) -> Scene:
    """The scene of some figures that move together, left to right as they are given.

    All are turned by one angle, so that the first faces +X at first. Frames are those of the first
    figure, thinned to at most `max_fps`; to `blend`, as many as that allows are made between them.
    The others are read at the same times and rest in their last frame when theirs is over.
    """
    if not figures:
        raise SkeletonError("nothing to show: expected at least one motion")
    world = empty_world()
    frame_time, times = _times(figures, max_fps, blend)
    heights = [figure.rig.standing_height * figure.scale for figure in figures]
    turn = _turn_to_front(figures[0])
    lanes = _lanes(figures, heights, turn)
    coordinates: list[Float[np.ndarray, "T n"]] = []
    placements: list[Placement] = []
    column = 0
    for k, figure in enumerate(figures):
        body = figure.subject.body or model_trajectory(figure.rig, figure.motion.frames(0, 1))
        first_body = len(list(world.bodies))
        columns, worn = _add_figure(world, figure, body, f"{k}_")
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
        ahead = quat_rotate(turn, figure.ahead)
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
        terrain = figure.subject.terrain
        if not figure.ghost and (terrain is not None or len(figure.tops)):
            if terrain is not None:
                shown = placement.to_scene(terrain.vertices)
                add_terrain(world, replace(terrain, vertices=shown), f"{k}_terrain")
            else:
                add_pillars(world, placement.to_scene(figure.tops), _PILLAR * heights[k])
            placement = replace(placement, ground=range(bodies.stop, bodies.stop + 1))
        placements.append(placement)
        column = following
    qpos = np.concatenate(coordinates, axis=1)
    return Scene(compiled(world), qpos, frame_time, tuple(placements))


def _add_figure(
    world: mujoco.MjSpec, figure: Figure, body: ModelTrajectory, prefix: str
) -> tuple[Int[np.ndarray, "n"], WornSkin | None]:
    """Add a figure's body to the world, in its skin where it wears one, under names that begin with
    `prefix`; the coordinates of its own model that move it, and the skin."""
    worn = None
    if figure.skin is not None and not figure.ghost:
        names = body_names(body.model, figure.rig, prefix)
        worn = worn_by(figure.skin, figure.rig, names, scale=figure.scale)
    columns = add_display(
        world, body, prefix, ghost=figure.ghost, scale=figure.scale, bare=worn is not None
    )
    if worn is not None:
        add_skin(world, worn, prefix)
    return columns, worn


def _times(
    figures: Sequence[Figure], max_fps: float, blend: bool
) -> tuple[float, Float[np.ndarray, "T"]]:
    """From one frame of the scene to the next [s], and when all of them are [s]."""
    first = figures[0].motion
    step = thinned(first.fps, max_fps)
    between = max(1, int(max_fps / first.fps * _SAME_FPS)) if blend else 1
    frame_time = first.frame_time * step / between
    longest = max(figure.motion.duration for figure in figures)
    return frame_time, np.arange(int(np.floor(longest / frame_time + 1e-6)) + 1) * frame_time


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


def _lanes(
    figures: Sequence[Figure], heights: Sequence[float], turn: Float[np.ndarray, "4"]
) -> Float[np.ndarray, "K"]:
    """Where each figure stands, from left to right as the camera sees them; the middle is 0. What
    is stated to be under them is side by side, too, as far as `_WIDEST`."""
    lanes = np.zeros(len(figures))
    reaches = [_reaches(figure, turn) for figure in figures]
    for k in range(1, len(figures)):
        if figures[k].ghost:
            lanes[k] = lanes[k - 1]
            continue
        height = (heights[k - 1] + heights[k]) / 2
        between = np.clip(reaches[k - 1][1] - reaches[k][0], 0.0, _WIDEST * height)
        lanes[k] = lanes[k - 1] + _SPACING * height + between
    return lanes - lanes[-1] / 2


def _reaches(figure: Figure, turn: Float[np.ndarray, "4"]) -> tuple[float, float]:
    """From where a figure starts to the two sides of what is stated to be under it [m, scene]."""
    terrain = figure.subject.terrain
    if terrain is None or figure.ghost:
        return 0.0, 0.0
    away = figure.scale * (terrain.vertices - figure.motion.root_pos[0])
    across = quat_rotate(turn, away)[:, 1]
    return float(across.min()), float(across.max())


def _turn_to_front(figure: Figure) -> Float[np.ndarray, "4"]:
    """The turn about Z after which the figure faces +X in its first frame."""
    ahead = figure.ahead
    if np.hypot(ahead[0], ahead[1]) < 0.3:  # lies: where it looks says nothing
        return np.array([1.0, 0, 0, 0])
    return quat_about("z", np.array(-np.arctan2(ahead[1], ahead[0])))
