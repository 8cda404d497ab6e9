"""Convex shapes in a few frames: how far points are beyond their sides."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from robots.model.shapes import DIRECTIONS
from robots.solver.hulls import Shape
from robots.solver.window_poses import WindowPoses

_SIDES = np.ascontiguousarray(DIRECTIONS.T)


class Polytopes:
    """Some shapes of these bodies, which are at `rest` in the rest pose [m]: each is what is inside
    all its half-spaces."""

    def __init__(
        self, shapes: Sequence[Shape], bodies: Int[np.ndarray, "L"], rest: Float[np.ndarray, "B 3"]
    ) -> None:
        reach = np.array([shape.reach for shape in shapes]).reshape(-1, len(DIRECTIONS))
        self._bodies = bodies
        self._reach = (reach - rest[bodies] @ _SIDES).T.copy()  # [m] from the body's place

    def beyond(
        self,
        poses: WindowPoses,
        which: Int[np.ndarray, "K"],
        points: Float[np.ndarray, "3 T K"],
    ) -> Float[np.ndarray, "26 T K"]:
        """How far [m] points [m, world] are beyond each side of some shapes, one each."""
        _, frames, count = points.shape
        inside = poses.from_bodies(self._bodies.take(which), points)
        across: Float[np.ndarray, "26 _"] = DIRECTIONS @ inside.reshape(3, frames * count)
        beyond = across.reshape(len(DIRECTIONS), frames, count)
        beyond -= self._reach.take(which, axis=1)[:, None]
        return beyond

    def normals(
        self,
        poses: WindowPoses,
        which: Int[np.ndarray, "K"],
        sides: Int[np.ndarray, "T K"],
        out: Float[np.ndarray, "3 T K"],
    ) -> None:
        """Which way [world] some of their sides look."""
        axes = poses.frames[:3].take(self._bodies.take(which), axis=3)
        axes *= _SIDES.take(sides, axis=1)[:, None]
        np.add.reduce(axes, out=out)
