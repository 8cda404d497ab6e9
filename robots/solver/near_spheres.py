"""Spheres of small shapes in a few frames, and how deep in the large ones of their pairs."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from robots.solver.polytopes import Polytopes
from robots.solver.window_poses import WindowPoses


@dataclass(frozen=True, eq=False)
class NearSpheres:
    """Of K spheres the numbers of the pairs of shapes, of the small one's body and of the large one
    among the `polytopes`; where the centre is from that body in the rest pose [m], and 1; and the
    radius with what the pair keeps between it [m]."""

    polytopes: Polytopes
    numbers: Int[np.ndarray, "3 K"]
    sizes: Float[np.ndarray, "5 K"]

    def __len__(self) -> int:
        return self.numbers.shape[1]

    @property
    def pairs(self) -> Int[np.ndarray, "K"]:
        """The numbers of their pairs of shapes."""
        return self.numbers[0]

    @property
    def large(self) -> Int[np.ndarray, "K"]:
        """The numbers of the large shapes."""
        return self.numbers[2]

    @property
    def radii(self) -> Float[np.ndarray, "K"]:
        """Their radii, with what is kept between a pair [m]."""
        return self.sizes[4]

    def at(self, which: Int[np.ndarray, "S"]) -> "NearSpheres":
        """Some of them."""
        numbers, sizes = self.numbers.take(which, axis=1), self.sizes.take(which, axis=1)
        return NearSpheres(self.polytopes, numbers, sizes)

    def centers(self, poses: WindowPoses) -> Float[np.ndarray, "3 T K"]:
        """Where they are [m, world]."""
        return poses.points(self.numbers[1], self.sizes[:4, None, None])

    def beyond(
        self, poses: WindowPoses, centers: Float[np.ndarray, "3 T K"]
    ) -> Float[np.ndarray, "26 T K"]:
        """How far [m] beyond each side of the large shapes."""
        return self.polytopes.beyond(poses, self.large, centers)

    def depth(self, poses: WindowPoses) -> Float[np.ndarray, "T K"]:
        """How deep [m] they are in the large shapes."""
        depth: Float[np.ndarray, "T K"] = self.radii - np.maximum.reduce(
            self.beyond(poses, self.centers(poses))
        )
        return depth
