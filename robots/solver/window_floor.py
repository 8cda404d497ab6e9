"""The floor under all parts in a few frames: `robots.solver.floor` for all shapes at once."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from robots.residuals import one_sided
from robots.solver.floor import FELT, Solid
from robots.solver.weights import FLOOR_ROUNDING, W_FLOOR
from robots.solver.window_poses import WindowPoses
from robots.solver.window_rows import Rows


class Lifted(NamedTuple):
    """Shapes that some dofs lift out of the floor: the shapes' `bodies`, and the dofs."""

    solids: tuple[Solid, ...]
    bodies: Int[np.ndarray, "K"]
    moving: Float[np.ndarray, "K D"]


class WindowFloor:
    """Under a robot's solid shapes. The first ones, `always`, are felt however high they are.
    `rest` is where all bodies are in the rest pose; `firm` is `robots.solver.weights.per_metre`."""

    def __init__(
        self, lifted: Lifted, rest: Float[np.ndarray, "B 3"], firm: float, *, always: int = 0
    ) -> None:
        solids = lifted.solids
        self._weight, self._rounding = firm * W_FLOOR, FLOOR_ROUNDING / firm
        counts = [len(solid.spheres) for solid in solids]
        self._bodies = np.repeat(lifted.bodies, counts)
        self._moving = np.repeat(lifted.moving, counts, axis=0)
        self._always = slice(sum(counts[:always]))
        self._radii = np.concatenate([np.zeros(0), *(solid.radii for solid in solids)])
        spheres = np.concatenate([np.zeros((0, 3)), *(solid.spheres for solid in solids)])
        self._arms = (spheres - rest[self._bodies]).T.copy()

    def depth(self, poses: WindowPoses) -> Float[np.ndarray, "T S"]:
        """How deep [m] each sphere is in the floor; below 0 over it."""
        up = poses.frames[:, 2].take(self._bodies, axis=2)
        x, y, z = up[:3] * self._arms[:, None]
        x += y
        x += z
        x += up[3]
        depth: Float[np.ndarray, "T S"] = self._radii - x
        return depth

    def rows(
        self,
        poses: WindowPoses,
        depth: Float[np.ndarray, "T S"],
        scale: Float[np.ndarray, "T"],
    ) -> Rows | None:
        """r = w one_sided(depth), w = `W_FLOOR` x `scale`, of what is felt in some frame."""
        near = depth > -FELT * self._rounding
        near[:, self._always] = True
        (felt,) = np.logical_or.reduce(near).nonzero()
        if not len(felt):
            return None
        weight = np.where(near.take(felt, axis=1), (self._weight * scale)[:, None], 0.0)
        across = poses.frames[:, :2].take(self._bodies.take(felt), axis=3)
        across[:3] *= self._arms[:, None, None].take(felt, axis=3)
        x, y = np.add.reduce(across)
        residual, slope = one_sided(depth.take(felt, axis=1), self._rounding)
        residual *= weight
        slope *= weight
        # What lifts a point (x, y, z): the twist's product with (y, -x, 0, 0, 0, 1).
        wrenches = np.zeros((*slope.shape, 6))
        np.multiply(-slope, y, out=wrenches[..., 0])
        np.multiply(slope, x, out=wrenches[..., 1])
        np.negative(slope, out=wrenches[..., 5])
        return Rows(wrenches, self._moving.take(felt, axis=0), residual)
