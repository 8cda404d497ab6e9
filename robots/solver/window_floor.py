"""The floor under all parts in a few frames: `robots.solver.floor` for all shapes at once."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from robots.residuals import one_sided
from robots.solver.floor import FELT, Solid
from robots.solver.weights import FLOOR_ROUNDING, W_FLOOR
from robots.solver.window_poses import WindowPoses, arms_of
from robots.solver.window_rows import Rows


class Lifted(NamedTuple):
    """Shapes that some dofs lift out of the floor: the shapes' `bodies`, and the dofs."""

    solids: tuple[Solid, ...]
    bodies: Int[np.ndarray, "K"]
    moving: Float[np.ndarray, "K D"]


class Low(NamedTuple):
    """The spheres that are near the floor in some frame, by their numbers, and how deep [m] they
    are in it; below 0 over it."""

    spheres: Int[np.ndarray, "S"]
    depth: Float[np.ndarray, "T S"]


class WindowFloor:
    """Under a robot's solid shapes. The first ones, `always`, are felt however high they are.
    `rest` is where all bodies are in the rest pose; `firm` is `robots.solver.weights.per_metre`."""

    def __init__(
        self, lifted: Lifted, rest: Float[np.ndarray, "B 3"], firm: float, *, always: int = 0
    ) -> None:
        solids = lifted.solids
        self._weight, self._rounding = firm * W_FLOOR, FLOOR_ROUNDING / firm
        self._felt = -FELT * self._rounding
        counts = [len(solid.spheres) for solid in solids]
        self._shape = np.repeat(np.arange(len(counts)), counts)
        self._always = slice(sum(counts[:always]))
        self._moving = lifted.moving
        spheres = [(solid.spheres, solid.radii) for solid in solids]
        self._spheres = _Spheres(lifted.bodies.take(self._shape), rest, spheres)
        self._balls = _Spheres(lifted.bodies, rest, [_around(*own) for own in spheres])

    def depth(self, poses: WindowPoses) -> Float[np.ndarray, "T S"]:
        """How deep [m] each sphere is in the floor; below 0 over it."""
        return self._spheres.depth(poses)

    def low(self, poses: WindowPoses, ground: Float[np.ndarray, "T A"] | None = None) -> Low:
        """The spheres of shapes that may be felt; those that always are stand on `ground` [m]."""
        balls = self._balls.depth(poses)
        near = np.logical_or.reduce(balls > self._felt).take(self._shape)
        near[self._always] = True
        spheres = near.nonzero()[0]
        depth = self._spheres.depth(poses, spheres)
        if ground is not None:
            depth[:, self._always] += ground
        return Low(spheres, depth)

    def rows(self, poses: WindowPoses, low: Low, scale: Float[np.ndarray, "T"]) -> Rows | None:
        """r = w one_sided(depth), w = `W_FLOOR` x `scale`, of what is felt in some frame."""
        near = low.depth > self._felt
        near[:, self._always] = True  # they are the first ones here, too
        (felt,) = np.logical_or.reduce(near).nonzero()
        if not len(felt):
            return None
        own = low.spheres.take(felt)
        weight = np.where(near.take(felt, axis=1), (self._weight * scale)[:, None], 0.0)
        x, y = self._spheres.across(poses, own)
        residual, slope = one_sided(low.depth.take(felt, axis=1), self._rounding)
        residual *= weight
        slope *= weight
        # What lifts a point (x, y, z): the twist's product with (y, -x, 0, 0, 0, 1).
        wrenches = np.zeros((*slope.shape, 6))
        np.multiply(-slope, y, out=wrenches[..., 0])
        np.multiply(slope, x, out=wrenches[..., 1])
        np.negative(slope, out=wrenches[..., 5])
        return Rows(wrenches, self._moving.take(self._shape.take(own), axis=0), residual)


class _Spheres:
    """Spheres of bodies, given in the rest pose."""

    def __init__(
        self,
        bodies: Int[np.ndarray, "S"],
        rest: Float[np.ndarray, "B 3"],
        spheres: Sequence[tuple[Float[np.ndarray, "_ 3"], Float[np.ndarray, "_"]]],
    ) -> None:
        centers = np.concatenate([np.zeros((0, 3)), *(own for own, _ in spheres)])
        self._bodies, self._arms = bodies, arms_of(centers - rest[bodies])
        self._radii = np.concatenate([np.zeros(0), *(radii for _, radii in spheres)])

    def depth(
        self, poses: WindowPoses, which: Int[np.ndarray, "S"] | None = None
    ) -> Float[np.ndarray, "T S"]:
        """How deep [m] they, or some of them, are in the floor; below 0 over it."""
        if which is None:
            return self._radii - poses.heights(self._bodies, self._arms[:, None])
        bodies, arms = self._bodies.take(which), self._arms.take(which, axis=1)
        return self._radii.take(which) - poses.heights(bodies, arms[:, None])

    def across(self, poses: WindowPoses, which: Int[np.ndarray, "S"]) -> Float[np.ndarray, "2 T S"]:
        """Where the centres of some are over the floor [m]."""
        across = poses.frames[:, :2].take(self._bodies.take(which), axis=3)
        across *= self._arms.take(which, axis=1)[:, None, None]
        out: Float[np.ndarray, "2 T S"] = np.add.reduce(across)
        return out


def _around(
    spheres: Float[np.ndarray, "S 3"], radii: Float[np.ndarray, "S"]
) -> tuple[Float[np.ndarray, "1 3"], Float[np.ndarray, "1"]]:
    """A ball around some spheres; nothing where there are none."""
    if not len(spheres):
        return np.zeros((1, 3)), np.array([-np.inf])
    center = (spheres.max(axis=0) + spheres.min(axis=0)) / 2
    reach = (np.linalg.norm(spheres - center, axis=1) + radii).max()
    return center[None], np.array([reach])
