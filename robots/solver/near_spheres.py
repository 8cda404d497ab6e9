"""Spheres of small shapes in a few frames, and how deep in the large ones of their pairs."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from robots.solver.hulls import SLABS
from robots.solver.window_poses import WindowPoses

_RADIUS, _MIDDLE, _HALF = 3, slice(4, 4 + len(SLABS)), slice(4 + len(SLABS), None)


@dataclass(frozen=True, eq=False)
class NearSpheres:
    """Of K spheres the numbers of the pairs of shapes, and of the bodies of the small and the large
    one; and where the centre is from the former in the rest pose, the radius with what the pair
    keeps between it [m], and the large one's slabs, from its body: their middles and half widths.
    All in two tables, so that some of them are soon picked."""

    numbers: Int[np.ndarray, "3 K"]
    sizes: Float[np.ndarray, "30 K"]

    def __len__(self) -> int:
        return self.numbers.shape[1]

    @property
    def pairs(self) -> Int[np.ndarray, "K"]:
        """The numbers of their pairs of shapes."""
        return self.numbers[0]

    @property
    def large(self) -> Int[np.ndarray, "K"]:
        """The bodies of the large shapes."""
        return self.numbers[2]

    @property
    def radii(self) -> Float[np.ndarray, "K"]:
        """Their radii, with what is kept between a pair [m]."""
        return self.sizes[_RADIUS]

    @property
    def half(self) -> Float[np.ndarray, "13 1 K"]:
        """Half the widths of the large shapes' slabs [m]."""
        return self.sizes[_HALF, None]

    def at(self, which: Int[np.ndarray, "S"]) -> "NearSpheres":
        """Some of them."""
        return NearSpheres(self.numbers.take(which, axis=1), self.sizes.take(which, axis=1))

    def depth(self, poses: WindowPoses) -> Float[np.ndarray, "T K"]:
        """How deep [m] they are in the large shapes."""
        return self.measured(poses)[2]

    def measured(
        self, poses: WindowPoses
    ) -> tuple[Float[np.ndarray, "3 T K"], Float[np.ndarray, "13 T K"], Float[np.ndarray, "T K"]]:
        """Where their centres are [m, world], how far from the middle of each slab, and how deep
        they are in the large shapes [m]."""
        points = poses.points(self.numbers[1], self.sizes[:_RADIUS, None, None])
        inside = poses.from_bodies(self.large, points)
        shape = points.shape[1:]
        off = (SLABS @ inside.reshape(3, shape[0] * shape[1])).reshape(len(SLABS), *shape)
        off -= self.sizes[_MIDDLE, None]
        over = np.abs(off)
        over -= self.half
        depth: Float[np.ndarray, "T K"] = self.radii - np.maximum.reduce(over)
        return points, off, depth
