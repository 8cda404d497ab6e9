"""Which pairs of shapes are near each other in a few frames: balls around them first."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from robots.solver.hulls import SLABS, ShapePair
from robots.solver.polytopes import Polytopes
from robots.solver.window_poses import WindowPoses, arms_of

_ACROSS = np.flatnonzero(np.abs(SLABS).max(axis=1) == 1.0)  # the slabs along x, y and z


class NearPairs:
    """Of some pairs, whose small shapes are within `radii` [m] of their centers, with what the pair
    keeps between it, and whose `large` shapes are among the `polytopes`. `bodies` are those of the
    links, `rest` is where they are in the rest pose [m], and `within` how near [m] counts."""

    def __init__(
        self,
        pairs: Sequence[ShapePair],
        radii: Float[np.ndarray, "P"],
        polytopes: Polytopes,
        large: Int[np.ndarray, "P"],
        bodies: Int[np.ndarray, "L"],
        rest: Float[np.ndarray, "B 3"],
        within: float,
    ) -> None:
        self._radii, self._within = radii, within
        self._polytopes, self._polytope = polytopes, large
        shapes = {shape.geom: shape for pair in pairs for shape in (pair.small, pair.large)}
        number = {geom: k for k, geom in enumerate(shapes)}
        links = [shape.link for shape in shapes.values()]
        self._bodies = np.tile(bodies[np.array(links, dtype=int)], 2)
        # Of all shapes the middles of the balls around them, then those of their boxes.
        middles = [shape.center for shape in shapes.values()]
        middles += [shape.slabs[0, _ACROSS] @ SLABS[_ACROSS] for shape in shapes.values()]
        places = np.array(middles).reshape(-1, 3) - rest[self._bodies]
        self._middles = arms_of(places)[:, None, None]
        self._small = np.array([number[pair.small.geom] for pair in pairs], dtype=int)
        self._large = np.array([number[pair.large.geom] for pair in pairs], dtype=int) + len(shapes)
        # A shape is within its box, which a ball that is near can't be beyond the corners of.
        half = np.array([pair.large.slabs[1, _ACROSS] for pair in pairs]).reshape(-1, 3)
        corners = half + (radii + within)[:, None]
        self._reach = (corners**2).sum(axis=1)

    def of(self, poses: WindowPoses) -> Int[np.ndarray, "N"]:
        """The numbers of those that are near in any frame."""
        middles = poses.points(self._bodies, self._middles)
        between = middles.take(self._small, axis=2) - middles.take(self._large, axis=2)
        between *= between
        may = np.logical_or.reduce(np.add.reduce(between) < self._reach).nonzero()[0]
        centers = middles.take(self._small.take(may), axis=2)
        beyond = self._polytopes.beyond(poses, self._polytope.take(may), centers)
        apart = np.maximum.reduce(beyond) - self._radii.take(may)
        near: Int[np.ndarray, N] = may[np.logical_or.reduce(apart < self._within)]
        return near
