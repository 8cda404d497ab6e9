"""The floor under all parts in a few frames: `robots.solver.floor` for all shapes at once."""

import numpy as np
from jaxtyping import Bool, Float, Int

from robots.residuals import one_sided
from robots.solver.floor import FELT, Solid
from robots.solver.weights import FLOOR_ROUNDING, W_FLOOR
from robots.solver.window_collision import WindowPoses


class WindowFloor:
    """Under a robot's solid shapes, but for the corners of its soles. `bodies` are those of the
    `solids`, `moving` the dofs that move them, of the block that solves for them; `rest` is where
    all bodies are in the rest pose; `firm` is `robots.solver.weights.per_metre`."""

    def __init__(
        self,
        solids: tuple[Solid, ...],
        bodies: Int[np.ndarray, "K"],
        moving: Bool[np.ndarray, "K D"],
        rest: tuple[Float[np.ndarray, "B 3 3"], Float[np.ndarray, "B 3"]],
        firm: float,
    ) -> None:
        self._weight, self._rounding = firm * W_FLOOR, FLOOR_ROUNDING / firm
        counts = [len(solid.spheres) for solid in solids]
        self._bodies, self._moving = np.repeat(bodies, counts), np.repeat(moving, counts, axis=0)
        self._radii = np.concatenate([np.zeros(0), *(solid.radii for solid in solids)])
        spheres = np.concatenate([np.zeros((0, 3)), *(solid.spheres for solid in solids)])
        rotations, positions = (part[self._bodies] for part in rest)
        self._spheres = np.einsum("kji,kj->ki", rotations, spheres - positions)

    def depth(self, poses: WindowPoses) -> Float[np.ndarray, "T S"]:
        """How deep [m] each sphere is in the floor; below 0 over it."""
        up = poses.rotations[:, self._bodies, 2]
        heights = (up * self._spheres).sum(axis=2) + poses.positions[:, self._bodies, 2]
        depth: Float[np.ndarray, "T S"] = self._radii - heights
        return depth

    def add_to(
        self,
        poses: WindowPoses,
        axes: Float[np.ndarray, "T D 3"],
        anchors: Float[np.ndarray, "T D 3"],
        scale: Float[np.ndarray, "T"],
        H: Float[np.ndarray, "T D D"],
        g: Float[np.ndarray, "T D"],
    ) -> None:
        """Add r = w one_sided(depth), w = `W_FLOOR` x `scale`, to the normal equations."""
        depth = self.depth(poses)
        frames, own = np.nonzero(depth > -FELT * self._rounding)
        if not len(own):
            return
        rotations = poses.rotations[frames, self._bodies[own], :2]
        point = (rotations @ self._spheres[own, :, None])[..., 0]
        arm = (point + poses.positions[frames, self._bodies[own], :2])[:, None] - anchors[
            frames, :, :2
        ]
        residual, slope = one_sided(depth[frames, own], self._rounding)
        weight = self._weight * scale[frames]
        # What lifts a point: the upward part of axis x arm.
        J = axes[frames, :, 0] * arm[..., 1] - axes[frames, :, 1] * arm[..., 0]
        J[:, 2] = 1.0
        J *= self._moving[own] * (-weight * slope)[:, None]
        residual = weight * residual
        for t in range(len(g)):
            rows = J[frames == t]
            H[t] += rows.T @ rows
            g[t] += residual[frames == t] @ rows
