"""What is drawn beside the bodies: names, contacts, centres of mass, paths, joints at a limit."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from scipy.spatial import ConvexHull, QhullError

from sim.view.annotations import Annotations
from sim.view.player import Player
from sim.view.scene import Placement
from spark.rotation import quat_rotate

RGBA = tuple[float, float, float, float]

_PAPER: RGBA = (1.0, 1.0, 1.0, 1.0)
_AHEAD: RGBA = (0.15, 0.39, 0.79, 0.9)
_MASS: RGBA = (0.45, 0.2, 0.75, 1.0)
_LIMIT: RGBA = (0.84, 0.19, 0.23, 1.0)
_PATH_POINTS = 200  # at most, of one path
_LIFT = 0.004  # [m] over the floor, so that what lies on it is seen


@dataclass(frozen=True, eq=False)
class Dot:
    """A ball."""

    at: Float[np.ndarray, "3"]
    radius: float
    rgba: RGBA


@dataclass(frozen=True, eq=False)
class Line:
    """A straight line of a width [m], or, where it is `thin`, [pixels]; an `arrow` points to its
    end."""

    start: Float[np.ndarray, "3"]
    end: Float[np.ndarray, "3"]
    width: float
    rgba: RGBA
    arrow: bool = False
    thin: bool = False


@dataclass(frozen=True, eq=False)
class Label:
    """Words that face the camera."""

    at: Float[np.ndarray, "3"]
    text: str
    rgba: RGBA


Mark = Dot | Line | Label


def marks(player: Player) -> Iterator[Mark]:
    """The marks of all figures, now."""
    for placement, known in zip(player.figures, player.annotations, strict=True):
        root = player.place(placement)
        if player.shown["names"]:
            yield from _name(player, placement, root)
        if player.shown["path"]:
            yield from _path(player, placement)
        if known is None:
            continue
        frame = known.frame(player.timeline.time)
        if player.shown["contacts"]:
            yield from _contacts(player, placement, known, frame)
        if player.shown["mass"]:
            yield from _mass(player, placement, known, frame)
        if player.shown["limits"]:
            yield from _limits(player, placement, known, frame)


def rgba(css: str) -> RGBA:
    """A colour that is written as "#rrggbb"."""
    red, green, blue = (int(css[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return red, green, blue, 1.0


def _name(player: Player, placement: Placement, root: Float[np.ndarray, "3"]) -> Iterator[Mark]:
    """The name over the head, and an arrow on the floor to where the figure faces."""
    height = placement.height
    above = root.copy()
    above[2] = max(1.06 * height, root[2] + 0.54 * height)
    yield Label(above, placement.label, _PAPER)
    quat = player.scene.qpos[player.timeline.frame, placement.columns][3:7]
    ahead = quat_rotate(quat, placement.ahead) * np.array([1.0, 1.0, 0.0])
    length = float(np.linalg.norm(ahead))
    if length < 0.3:  # it lies: the floor shows no way ahead
        return
    foot = np.array([root[0], root[1], _LIFT])
    ahead /= length
    yield Line(
        foot + 0.14 * height * ahead,
        foot + 0.34 * height * ahead,
        0.018 * height,
        _AHEAD,
        arrow=True,
    )


def _path(player: Player, placement: Placement) -> Iterator[Mark]:
    """The root's path on the floor, with what has gone by now dark."""
    path = player.scene.path(placement) + player.shift(placement)
    path[:, 2] = _LIFT
    picked = np.unique(np.linspace(0, len(path) - 1, _PATH_POINTS).round().astype(int))
    for start, end in pairwise(picked):
        gone = start < player.timeline.frame
        color = (*_AHEAD[:3], 0.95 if gone else 0.3)
        yield Line(path[start], path[end], 3.0, color, thin=True)


def _contacts(
    player: Player, placement: Placement, known: Annotations, frame: int
) -> Iterator[Mark]:
    states = known.states[frame]
    points = placement.to_scene(known.corners[frame]) + player.shift(placement)
    for point, state in zip(points, states, strict=True):
        if state:
            radius = (0.012 if state == 1 else 0.018) * placement.height
            yield Dot(point, radius, rgba(known.corner_states[state - 1][1]))


def _mass(player: Player, placement: Placement, known: Annotations, frame: int) -> Iterator[Mark]:
    """The centre of mass, the point below it, and the hull of the soles' corners that may bear."""
    height = placement.height
    shift = player.shift(placement)
    com = placement.to_scene(known.com[frame]) + shift
    below = np.array([com[0], com[1], _LIFT])
    yield Dot(com, 0.025 * height, _MASS)
    yield Dot(below, 0.012 * height, _MASS)
    yield Line(com, below, 0.004 * height, (*_MASS[:3], 0.7))
    near = known.corners[frame][known.corners[frame][:, 2] < known.support_height]
    hull = _hull(placement.to_scene(near) + shift)
    for start, end in zip(hull, np.roll(hull, -1, axis=0), strict=True):
        yield Line(start, end, 0.007 * height, (*_MASS[:3], 0.9))


def _hull(points: Float[np.ndarray, "N 3"]) -> Float[np.ndarray, "M 3"]:
    """The corners of the points' hull seen from above, on the floor."""
    flat = points * np.array([1.0, 1.0, 0.0]) + np.array([0.0, 0.0, _LIFT])
    try:
        return flat[ConvexHull(flat[:, :2]).vertices]
    except (QhullError, ValueError):  # fewer than three, or all in a line
        return flat


def _limits(player: Player, placement: Placement, known: Annotations, frame: int) -> Iterator[Mark]:
    for k in np.flatnonzero(known.at_limit[frame]):
        at = placement.to_scene(known.joints[frame, k]) + player.shift(placement)
        yield Dot(at, 0.03 * placement.height, (*_LIMIT[:3], 0.8))
        yield Label(at + np.array([0, 0, 0.03 * placement.height]), known.joint_names[k], _LIMIT)
