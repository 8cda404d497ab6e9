"""Self-collision in a few frames: `robots.solver.collision` for all shapes at once."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from robots.model.morphology import Morphology
from robots.residuals import one_sided
from robots.solver.collision import DEPTH_ROUNDING, collisions_of
from robots.solver.hulls import SLABS, ShapePair
from robots.solver.weights import W_COLLISION, W_LEG_COLLISION, per_metre
from robots.tree import Tree

_ACTIVE = 3 * DEPTH_ROUNDING  # [m] between shapes beyond which the penalty is negligible
# [m] that parts keep between them beyond a whole clip's clearance, for how far a soft penalty gives
# way is not repaired here; and how far apart [m] they are in the T-pose: others are always near.
_MARGIN, _FAR = 0.005, 0.1
_REACH = 0.03  # [m] that shapes may move between the searched frame and the others


@dataclass(frozen=True, eq=False)
class WindowPoses:
    """The poses of a model's bodies, and its joints' axes and anchors, in T frames [world]."""

    rotations: Float[np.ndarray, "T B 3 3"]
    positions: Float[np.ndarray, "T B 3"]
    axes: Float[np.ndarray, "T N 3"]
    anchors: Float[np.ndarray, "T N 3"]

    def at(self, frames: slice) -> "WindowPoses":
        """Those of some frames."""
        return WindowPoses(
            self.rotations[frames], self.positions[frames], self.axes[frames], self.anchors[frames]
        )


class WindowCollisions:
    """A robot's pairs of shapes that can meet. `bodies` are those of the tree's links and, last, of
    the base; `rest` is where all bodies are in the rest pose; `first_block` are the links that are
    solved for first: later ones give way to them. With `later_only`, first ones are given: what
    they do to each other is not looked at."""

    def __init__(
        self,
        robot: Morphology,
        bodies: Int[np.ndarray, "L"],
        rest: tuple[Float[np.ndarray, "B 3 3"], Float[np.ndarray, "B 3"]],
        first_block: Int[np.ndarray, "F"],
        *,
        later_only: bool,
    ) -> None:
        self._rest_rotations, self._rest_positions = rest
        tree, first = robot.tree, set(first_block.tolist())
        pairs = collisions_of(robot).pairs
        if later_only:
            pairs = tuple(pair for pair in pairs if not _among(pair, tree, first))
        shapes = {x.geom: x for pair in pairs for x in (pair.small, pair.large)}
        number = {geom: k for k, geom in enumerate(shapes)}
        self._shapes = bodies[[shape.link for shape in shapes.values()]]
        centers = [shape.center for shape in shapes.values()]
        self._centers = self._local(centers, self._shapes)
        self._small = np.array([number[pair.small.geom] for pair in pairs], dtype=int)
        self._large = np.array([number[pair.large.geom] for pair in pairs], dtype=int)
        apart = [pair.clearance + _MARGIN * (pair.gap > _FAR) for pair in pairs]
        bounds = [
            pair.small.bound + pair.large.bound + own + _ACTIVE + _REACH
            for pair, own in zip(pairs, apart, strict=True)
        ]
        self._bounds = np.array(bounds) ** 2
        self._slabs = np.array([pair.large.slabs for pair in pairs]).reshape(-1, 2, len(SLABS))
        counts = [len(pair.small.spheres) for pair in pairs]
        self._pairs = np.repeat(np.arange(len(pairs)), counts)
        spheres = [s for pair in pairs for s in pair.small.spheres]
        self._spheres = self._local(spheres, self._shapes[self._small[self._pairs]])
        radii = [r + own for pair, own in zip(pairs, apart, strict=True) for r in pair.small.radii]
        self._radii = np.array(radii)
        self._index_dofs(per_metre(robot), tree, pairs, first)

    def candidates(self, poses: WindowPoses) -> Int[np.ndarray, "K"]:
        """The spheres that collide, or may soon."""
        centers = _placed(poses, self._shapes, self._centers)
        x, y, z = (centers[:, self._small] - centers[:, self._large]).transpose(2, 0, 1)
        pairs = (x * x + y * y + z * z < self._bounds).any(0)
        candidates = np.flatnonzero(pairs[self._pairs])
        depth = self._depth(candidates, self._inside(poses, candidates))
        return candidates[(depth > -_ACTIVE - _REACH).any(0)]

    def add_to(
        self,
        poses: WindowPoses,
        axes: Float[np.ndarray, "T D 3"],
        anchors: Float[np.ndarray, "T D 3"],
        candidates: Int[np.ndarray, "K"],
        H: Float[np.ndarray, "T D D"],
        g: Float[np.ndarray, "T D"],
    ) -> None:
        """Add how deep shapes are in each other to the normal equations; `candidates` are the
        spheres to look at."""
        inside = self._inside(poses, candidates)
        depth = self._depth(candidates, inside)
        frames, active = np.nonzero(depth > -_ACTIVE)
        if not len(active):
            return
        pairs = self._pairs[candidates[active]]
        small, large = self._shapes[self._small[pairs]], self._shapes[self._large[pairs]]
        point = _turned(poses.rotations[frames, small], self._spheres[candidates[active]])
        arm = (point + poses.positions[frames, small])[:, None] - anchors[frames]
        off = inside[frames, active] @ SLABS.T - self._slabs[pairs, 0]
        slab = (np.abs(off) - self._slabs[pairs, 1]).argmax(axis=1)
        side = SLABS[slab] * np.sign(off[np.arange(len(off)), slab])[:, None]
        push = _turned(self._rest_rotations[large].transpose(0, 2, 1), side)
        push = _turned(poses.rotations[frames, large], push)
        residual, slope = one_sided(depth[frames, active], DEPTH_ROUNDING)
        # axis x arm . push = axis . arm x push
        (a, b, c), (x, y, z) = np.moveaxis(arm, 2, 0), push.T[:, :, None]
        u, v, w = np.moveaxis(axes[frames], 2, 0)
        J = u * (b * z - c * y) + v * (c * x - a * z) + w * (a * y - b * x)
        J *= self._signs[pairs] * (slope * self._weights[pairs])[:, None]
        residual = residual * self._weights[pairs]
        for t in range(len(g)):
            rows = J[frames == t]
            H[t] += rows.T @ rows
            g[t] += residual[frames == t] @ rows

    def _inside(
        self, poses: WindowPoses, candidates: Int[np.ndarray, "K"]
    ) -> Float[np.ndarray, "T K 3"]:
        """Where spheres are in the rest pose of the large shapes of their pairs, whose sides are
        known there."""
        pairs, own = np.unique(self._pairs[candidates], return_inverse=True)
        small, large = self._shapes[self._small[pairs]], self._shapes[self._large[pairs]]
        back = self._rest_rotations[large] @ poses.rotations[:, large].transpose(0, 1, 3, 2)
        turns = back @ poses.rotations[:, small]
        shifts = _turned(back, poses.positions[:, small] - poses.positions[:, large])
        shifts += self._rest_positions[large]
        return _turned(turns[:, own], self._spheres[candidates]) + shifts[:, own]

    def _depth(
        self, candidates: Int[np.ndarray, "K"], inside: Float[np.ndarray, "T K 3"]
    ) -> Float[np.ndarray, "T K"]:
        """How deep [m] spheres are in the large shapes of their pairs."""
        middle, half = self._slabs[self._pairs[candidates]].transpose(1, 0, 2)
        over = inside @ SLABS.T
        over -= middle
        np.abs(over, out=over)
        over -= half
        depth: Float[np.ndarray, "T K"] = self._radii[candidates] - over.max(axis=2)
        return depth

    def _local(
        self, points: list[Float[np.ndarray, "3"]], bodies: Int[np.ndarray, "K"]
    ) -> Float[np.ndarray, "K 3"]:
        """Points of the rest pose in the axes of their bodies."""
        away = np.array(points).reshape(-1, 3) - self._rest_positions[bodies]
        return np.einsum("kji,kj->ki", self._rest_rotations[bodies], away)

    def _index_dofs(
        self, firm: float, tree: Tree, pairs: tuple[ShapePair, ...], first: set[int]
    ) -> None:
        """Which columns move the pairs together (-1) and apart, of the links that give way."""
        self._signs = np.zeros((len(pairs), tree.nv))
        self._weights = np.full(len(pairs), firm * W_COLLISION)
        for k, pair in enumerate(pairs):
            chains = [tree.chain(part.link) for part in (pair.small, pair.large)]
            both = set(chains[0]) & set(chains[1])
            early = _among(pair, tree, first)
            if early:
                self._weights[k] = firm * W_LEG_COLLISION
            for sign, chain in zip((-1.0, 1.0), chains, strict=True):
                moving = tuple(j for j in chain if j not in both and (j in first) == early)
                self._signs[k, tree.dofs(moving)] = sign


def _among(pair: ShapePair, tree: Tree, links: set[int]) -> bool:
    """Whether no other links than these move the two."""
    return links.issuperset(tree.chain(pair.small.link) + tree.chain(pair.large.link))


def _placed(
    poses: WindowPoses, bodies: Int[np.ndarray, "K"], points: Float[np.ndarray, "K 3"]
) -> Float[np.ndarray, "T K 3"]:
    return _turned(poses.rotations[:, bodies], points) + poses.positions[:, bodies]


def _turned(
    turns: Float[np.ndarray, "*t K 3 3"], vectors: Float[np.ndarray, "*#t K 3"]
) -> Float[np.ndarray, "*t K 3"]:
    """Three times as fast as a product of matrices, where these are many and small."""
    x, y, z = (vectors[..., k, None] for k in range(3))
    return turns[..., 0] * x + turns[..., 1] * y + turns[..., 2] * z
