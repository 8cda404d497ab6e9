"""Spheres of small shapes in a few frames, and how deep in the large ones of their pairs."""

from dataclasses import dataclass, fields

import numpy as np
from jaxtyping import Float, Int

from robots.solver.hulls import SLABS
from robots.solver.window_poses import WindowPoses


@dataclass(frozen=True, eq=False)
class NearSpheres:
    """Of K spheres the numbers of the pairs of shapes, the bodies of the small and the large one,
    where the centre is from the former in the rest pose, and the radius with what the pair keeps
    between it [m]; and the large one's slabs, from its body: `middle` and `half` width."""

    pairs: Int[np.ndarray, "K"]
    small: Int[np.ndarray, "K"]
    large: Int[np.ndarray, "K"]
    centers: Float[np.ndarray, "3 1 1 K"]
    radii: Float[np.ndarray, "K"]
    middle: Float[np.ndarray, "13 1 K"]
    half: Float[np.ndarray, "13 1 K"]

    def __len__(self) -> int:
        return len(self.pairs)

    def at(self, which: Int[np.ndarray, "S"]) -> "NearSpheres":
        """Some of them."""
        parts = (getattr(self, part.name) for part in fields(self))
        return NearSpheres(*(part.take(which, axis=-1) for part in parts))

    def depth(self, poses: WindowPoses) -> Float[np.ndarray, "T K"]:
        """How deep [m] they are in the large shapes."""
        return self.measured(poses)[2]

    def measured(
        self, poses: WindowPoses
    ) -> tuple[Float[np.ndarray, "3 T K"], Float[np.ndarray, "13 T K"], Float[np.ndarray, "T K"]]:
        """Where their centres are [m, world], how far from the middle of each slab, and how deep
        they are in the large shapes [m]."""
        points = poses.points(self.small, self.centers)
        inside = poses.from_bodies(self.large, points)
        shape = points.shape[1:]
        off = (SLABS @ inside.reshape(3, shape[0] * shape[1])).reshape(len(SLABS), *shape)
        off -= self.middle
        over = np.abs(off)
        over -= self.half
        depth: Float[np.ndarray, "T K"] = self.radii - over.max(axis=0)
        return points, off, depth
