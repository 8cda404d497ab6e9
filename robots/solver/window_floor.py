"""The floor under all parts in a few frames: `robots.solver.floor` for all shapes at once."""

from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int

from robots.residuals import one_sided
from robots.solver.floor import FELT, Solid
from robots.solver.weights import FLOOR_ROUNDING, W_FLOOR
from robots.solver.window_poses import WindowPoses


class WindowFloor:
    """Under a robot's solid shapes, but for the corners of its soles. `bodies` are those of the
    `solids`, `moving` the dofs that move them, of the block that solves for them; `rest` is where
    all bodies are in the rest pose; `firm` is `robots.solver.weights.per_metre`."""

    def __init__(
        self,
        solids: tuple[Solid, ...],
        bodies: Int[np.ndarray, "K"],
        moving: Bool[np.ndarray, "K D"],
        rest: Float[np.ndarray, "B 3"],
        firm: float,
    ) -> None:
        self._weight, self._rounding = firm * W_FLOOR, FLOOR_ROUNDING / firm
        counts = [len(solid.spheres) for solid in solids]
        self._bodies, self._moving = np.repeat(bodies, counts), np.repeat(moving, counts, axis=0)
        self._radii = np.concatenate([np.zeros(0), *(solid.radii for solid in solids)])
        spheres = np.concatenate([np.zeros((0, 3)), *(solid.spheres for solid in solids)])
        self._arms = (spheres - rest[self._bodies]).T

    def depth(self, poses: WindowPoses) -> Float[np.ndarray, "T S"]:
        """How deep [m] each sphere is in the floor; below 0 over it."""
        up = poses.frames[:, 2].take(self._bodies, axis=2)
        x, y, z = up[:3] * self._arms[:, None]
        depth: Float[np.ndarray, "T S"] = self._radii - (x + y + z + up[3])
        return depth

    def add_to(
        self,
        poses: WindowPoses,
        twists: Float[np.ndarray, "T 6 D"],
        scale: Float[np.ndarray, "T"],
        H: Float[np.ndarray, "T D D"],
        g: Float[np.ndarray, "T D"],
    ) -> None:
        """Add r = w one_sided(depth), w = `W_FLOOR` x `scale`, to the normal equations; `twists`
        are the dofs', about the origin."""
        depth = self.depth(poses)
        frames, own = np.nonzero(depth > -FELT * self._rounding)
        if not len(own):
            return
        across = poses.frames[:, :2, frames, self._bodies[own]]
        x, y = (across[:3] * self._arms[:, None, own]).sum(axis=0) + across[3]
        # What lifts a point (x, y, z): the twist's product with (y, -x, 0, 0, 0, 1).
        wrenches = np.zeros((6, len(own)))
        wrenches[0], wrenches[1] = y, -x
        wrenches[5] = 1.0
        residual, slope = one_sided(depth[frames, own], self._rounding)
        weight = self._weight * scale[frames]
        J = self._moving[own] * (-weight * slope)[:, None]
        residual = weight * residual
        ends = np.searchsorted(frames, np.arange(len(g) + 1)).tolist()
        for t, (start, stop) in enumerate(pairwise(ends)):
            here = slice(start, stop)
            rows = J[here] * (wrenches[:, here].T @ twists[t])
            H[t] += rows.T @ rows
            g[t] += residual[here] @ rows
