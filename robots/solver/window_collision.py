"""Self-collision in a few frames: `robots.solver.collision` for all shapes at once."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int

from robots.model.morphology import Morphology
from robots.residuals import one_sided
from robots.solver.collision import DEPTH_ROUNDING, collisions_of
from robots.solver.hulls import SLABS, Shape, ShapePair
from robots.solver.near_pairs import NearPairs
from robots.solver.near_spheres import NearSpheres
from robots.solver.weights import W_COLLISION, W_LEG_COLLISION, per_metre
from robots.solver.window_dofs import WindowDofs
from robots.solver.window_poses import WindowPoses
from robots.solver.window_rows import Rows
from robots.tree import ROOT, Tree, cross

_ACTIVE = 3 * DEPTH_ROUNDING  # [m] between shapes beyond which the penalty is negligible
# [m] that parts keep between them beyond a whole clip's clearance, for how far a soft penalty gives
# way is not repaired here; and how far apart [m] they are in the T-pose: others are always near.
_MARGIN, _FAR = 0.005, 0.1
_SIDES = np.ascontiguousarray(SLABS.T)
_REACH = 0.03  # [m] that shapes may move between the searched frame and the others
_WITHIN = _ACTIVE + _REACH


class WindowCollisions:
    """A robot's pairs of shapes that can meet. `rest` is where all bodies are in the rest pose [m].
    The links of the first block are solved for first: later ones give way to them, and where only
    these are solved for, what the first do to each other is not looked at."""

    def __init__(self, robot: Morphology, dofs: WindowDofs, rest: Float[np.ndarray, "B 3"]) -> None:
        tree, first = robot.tree, dofs.first_links
        pairs = collisions_of(robot).pairs
        if dofs.later_only:
            pairs = tuple(pair for pair in pairs if not _among(pair, tree, first))
        apart = np.array([pair.clearance + _MARGIN * (pair.gap > _FAR) for pair in pairs])
        bodies = dofs.bodies([*range(len(tree)), ROOT])
        balls = [(pair.small.center[None], np.array([_bound(pair.small)])) for pair in pairs]
        bounds = _near(pairs, balls, apart, bodies, rest)
        self._pairs, self._count = NearPairs(pairs, bounds, bodies, rest, _WITHIN), len(pairs)
        spheres = [(pair.small.spheres, pair.small.radii) for pair in pairs]
        self._spheres = _near(pairs, spheres, apart, bodies, rest)
        self._index_dofs(per_metre(robot), tree, pairs, dofs)

    def candidates(self, poses: WindowPoses) -> NearSpheres:
        """The spheres that collide, or may soon."""
        is_near = np.zeros(self._count, dtype=bool)
        is_near[self._pairs.of(poses)] = True
        near = self._spheres.at(is_near.take(self._spheres.pairs).nonzero()[0])
        return near.at(np.logical_or.reduce(near.depth(poses) > -_WITHIN).nonzero()[0])

    def rows(self, poses: WindowPoses, near: NearSpheres) -> Rows | None:
        """How deep spheres are in shapes, of those that are `near` and felt in some frame."""
        points, off, depth = near.measured(poses)
        felt = depth > -_ACTIVE
        (active,) = np.logical_or.reduce(felt).nonzero()
        if not len(active):
            return None
        points, off, depth = (part.take(active, axis=-1) for part in (points, off, depth))
        felt, near = felt.take(active, axis=1), near.at(active)
        slab = (np.abs(off) - near.half).argmax(axis=0)
        side = _SIDES.take(slab, axis=1)
        across = off.reshape(len(off), -1)[slab.ravel(), np.arange(slab.size)]
        side *= np.sign(across).reshape(slab.shape)
        axes = poses.frames[:3].take(near.large, axis=3)
        axes *= side[:, None]
        wrenches = np.empty((6, *depth.shape))
        np.add.reduce(axes, out=wrenches[3:])
        cross(points, wrenches[3:], wrenches[:3])
        residual, slope = one_sided(depth, DEPTH_ROUNDING)
        slope *= felt
        wrenches *= slope
        weights, moving = self._weights.take(near.pairs), self._moving.take(near.pairs, axis=0)
        residual *= felt * weights
        return Rows(wrenches.transpose(1, 2, 0), moving, residual)

    def _index_dofs(
        self, firm: float, tree: Tree, pairs: tuple[ShapePair, ...], dofs: WindowDofs
    ) -> None:
        """Which columns move the pairs together (-1) and apart, of the links that give way; all
        weighted."""
        first = dofs.first_links
        self._moving = np.zeros((len(pairs), tree.nv))
        self._weights = np.full(len(pairs), firm * W_COLLISION)
        for k, pair in enumerate(pairs):
            chains = [tree.chain(part.link) for part in (pair.small, pair.large)]
            both = set(chains[0]) & set(chains[1])
            early = _among(pair, tree, first)
            if early:
                self._weights[k] = firm * W_LEG_COLLISION
            for sign, chain in zip((-1.0, 1.0), chains, strict=True):
                moving = tuple(j for j in chain if j not in both and (j in first) == early)
                self._moving[k, tree.dofs(moving)] = sign
        self._moving = self._moving.take(dofs.numbers, axis=1) * self._weights[:, None]


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
    sizes = np.concatenate(
        [(centers - rest[small]).T, [radii + apart[own]], middle - SLABS @ rest[large].T, half]
    )
    return NearSpheres(np.stack([own, small, large]), np.ascontiguousarray(sizes))
