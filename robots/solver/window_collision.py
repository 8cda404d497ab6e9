"""Self-collision in a few frames: `robots.solver.collision` for all shapes at once."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

from robots.model.morphology import Morphology
from robots.residuals import one_sided
from robots.solver.collision import DEPTH_ROUNDING, collisions_of
from robots.solver.hulls import SLABS, Shape, ShapePair
from robots.solver.near_spheres import NearSpheres
from robots.solver.weights import W_COLLISION, W_LEG_COLLISION, per_metre
from robots.solver.window_poses import WindowPoses
from robots.tree import Tree, cross

_ACTIVE = 3 * DEPTH_ROUNDING  # [m] between shapes beyond which the penalty is negligible
# [m] that parts keep between them beyond a whole clip's clearance, for how far a soft penalty gives
# way is not repaired here; and how far apart [m] they are in the T-pose: others are always near.
_MARGIN, _FAR = 0.005, 0.1
_REACH = 0.03  # [m] that shapes may move between the searched frame and the others


class WindowCollisions:
    """A robot's pairs of shapes that can meet. `bodies` are those of the tree's links and, last, of
    the base; `rest` is where all bodies are in the rest pose [m]; `first` are the links that are
    solved for first: later ones give way to them. `dofs` are the columns. With `later_only`, first
    links are given: what they do to each other is not looked at."""

    def __init__(
        self,
        robot: Morphology,
        bodies: Int[np.ndarray, "L"],
        rest: Float[np.ndarray, "B 3"],
        first: set[int],
        dofs: Int[np.ndarray, "D"],
        *,
        later_only: bool,
    ) -> None:
        tree = robot.tree
        pairs = collisions_of(robot).pairs
        if later_only:
            pairs = tuple(pair for pair in pairs if not _among(pair, tree, first))
        apart = np.array([pair.clearance + _MARGIN * (pair.gap > _FAR) for pair in pairs])
        balls = [(pair.small.center[None], np.array([_bound(pair.small)])) for pair in pairs]
        self._bounds = _near(pairs, balls, apart, bodies, rest)
        spheres = [(pair.small.spheres, pair.small.radii) for pair in pairs]
        self._spheres = _near(pairs, spheres, apart, bodies, rest)
        self._index_dofs(per_metre(robot), tree, pairs, first, dofs)

    def candidates(self, poses: WindowPoses) -> NearSpheres:
        """The spheres that collide, or may soon."""
        pairs = (self._bounds.depth(poses) > -_ACTIVE - _REACH).any(axis=0)
        near = self._spheres.at(np.flatnonzero(pairs.take(self._spheres.pairs)))
        return near.at(np.flatnonzero((near.depth(poses) > -_ACTIVE - _REACH).any(axis=0)))

    def add_to(
        self,
        poses: WindowPoses,
        twists: Float[np.ndarray, "T 6 D"],
        near: NearSpheres,
        H: Float[np.ndarray, "T D D"],
        g: Float[np.ndarray, "T D"],
    ) -> None:
        """Add how deep spheres are in shapes to the normal equations, of those that are `near`;
        `twists` are the dofs', about the origin."""
        points, off, depth = near.measured(poses)
        frames, active = np.nonzero(depth > -_ACTIVE)
        if not len(active):
            return
        off = off[:, frames, active]
        slab = (np.abs(off) - near.half[:, 0, active]).argmax(axis=0)
        side = SLABS[slab].T * np.sign(off[slab, np.arange(len(slab))])
        axes = poses.frames[:3, :, frames, near.large[active]]
        wrenches = np.empty((6, len(active)))
        wrenches[3:] = (axes * side[:, None]).sum(axis=0)
        cross(points[:, frames, active], wrenches[3:], wrenches[:3])
        residual, slope = one_sided(depth[frames, active], DEPTH_ROUNDING)
        pairs = near.pairs[active]
        weights = self._weights[pairs]
        J = self._signs[pairs] * (slope * weights)[:, None]
        residual *= weights
        ends = np.searchsorted(frames, np.arange(len(g) + 1)).tolist()
        for t, (start, stop) in enumerate(pairwise(ends)):
            own = slice(start, stop)
            rows = J[own] * (wrenches[:, own].T @ twists[t])
            H[t] += rows.T @ rows
            g[t] += residual[own] @ rows

    def _index_dofs(
        self,
        firm: float,
        tree: Tree,
        pairs: tuple[ShapePair, ...],
        first: set[int],
        dofs: Int[np.ndarray, "D"],
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
        self._signs = self._signs[:, dofs]


def _among(pair: ShapePair, tree: Tree, links: set[int]) -> bool:
    """Whether no other links than these move the two."""
    return links.issuperset(tree.chain(pair.small.link) + tree.chain(pair.large.link))


def _bound(shape: Shape) -> float:
    """How far [m] the spheres of a shape reach from its center."""
    away = np.linalg.norm(shape.spheres - shape.center, axis=1)
    return float((away + shape.radii).max())


def _near(
    pairs: tuple[ShapePair, ...],
    balls: Sequence[tuple[Float[np.ndarray, "_ 3"], Float[np.ndarray, "_"]]],
    apart: Float[np.ndarray, "P"],
    bodies: Int[np.ndarray, "L"],
    rest: Float[np.ndarray, "B 3"],
) -> NearSpheres:
    """Some balls of the small shapes of all pairs, which are kept so far `apart` [m]."""
    own = np.repeat(np.arange(len(pairs)), [len(radii) for _, radii in balls])
    small = bodies[[pair.small.link for pair in pairs]][own]
    large = bodies[[pair.large.link for pair in pairs]][own]
    centers = np.concatenate([np.zeros((0, 3)), *(centers for centers, _ in balls)])
    radii = np.concatenate([np.zeros(0), *(radii for _, radii in balls)])
    slabs = np.array([pair.large.slabs for pair in pairs]).reshape(-1, 2, len(SLABS))[own]
    middle, half = slabs.transpose(1, 2, 0)
    return NearSpheres(
        own,
        small,
        large,
        (centers - rest[small]).T[:, None, None],
        radii + apart[own],
        (middle - SLABS @ rest[large].T)[:, None],
        half[:, None],
    )
