"""Self-collision in a few frames: `robots.solver.collision` for all shapes at once."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from robots.model.morphology import Morphology
from robots.residuals import one_sided
from robots.solver.collision import DEPTH_ROUNDING, collisions_of
from robots.solver.hulls import Shape, ShapePair
from robots.solver.near_pairs import NearPairs
from robots.solver.near_spheres import NearSpheres
from robots.solver.polytopes import Polytopes
from robots.solver.weights import W_COLLISION, W_LEG_COLLISION, per_metre
from robots.solver.window_dofs import WindowDofs
from robots.solver.window_poses import WindowPoses, arms_of
from robots.solver.window_rows import Rows
from robots.tree import ROOT, Tree

_ACTIVE = 3 * DEPTH_ROUNDING  # [m] between shapes beyond which the penalty is negligible
# [m] that parts keep between them beyond a whole clip's clearance, for how far a soft penalty gives
# way is not repaired here; and how far apart [m] they are in the T-pose: others are always near.
_MARGIN, _FAR = 0.005, 0.1
_REACH = 0.03  # [m] that shapes may move between the searched frame and the others
_WITHIN = _ACTIVE + _REACH


class WindowCollisions:
    """A robot's pairs of shapes that can meet. `rest` is where all bodies are in the rest pose [m].
    The links of the first block are solved for first: later ones give way to them. What the dofs do
    not move is not looked at."""

    def __init__(self, robot: Morphology, dofs: WindowDofs, rest: Float[np.ndarray, "B 3"]) -> None:
        tree = robot.tree
        pairs = collisions_of(robot).pairs
        moving, weights = _moving(per_metre(robot), tree, pairs, dofs)
        moved = np.flatnonzero(moving.any(axis=1))
        self._moving, self._weights = moving[moved], weights[moved]
        pairs = tuple(pairs[k] for k in moved.tolist())
        apart = np.array([pair.clearance + _MARGIN * (pair.gap > _FAR) for pair in pairs])
        bodies = dofs.bodies([*range(len(tree)), ROOT])
        shapes = list({pair.large.geom: pair.large for pair in pairs}.values())
        number = {shape.geom: k for k, shape in enumerate(shapes)}
        large = np.array([number[pair.large.geom] for pair in pairs], dtype=int)
        polytopes = Polytopes(shapes, bodies[[shape.link for shape in shapes]], rest)
        radii = apart + [_bound(pair.small) for pair in pairs]
        self._pairs = NearPairs(pairs, radii, polytopes, large, bodies, rest, _WITHIN)
        self._count = len(pairs)
        own = np.repeat(np.arange(len(pairs)), [len(pair.small.radii) for pair in pairs])
        small = bodies[[pair.small.link for pair in pairs]][own]
        centers = np.concatenate([np.zeros((0, 3)), *(pair.small.spheres for pair in pairs)])
        radii = np.concatenate([np.zeros(0), *(pair.small.radii for pair in pairs)])
        sizes = np.concatenate([arms_of(centers - rest[small]), [radii + apart[own]]])
        self._spheres = NearSpheres(polytopes, np.stack([own, small, large[own]]), sizes)

    def candidates(self, poses: WindowPoses) -> NearSpheres:
        """The spheres that collide, or may soon."""
        is_near = np.zeros(self._count, dtype=bool)
        is_near[self._pairs.of(poses)] = True
        near = self._spheres.at(is_near.take(self._spheres.pairs).nonzero()[0])
        return near.at(np.logical_or.reduce(near.depth(poses) > -_WITHIN).nonzero()[0])

    def rows(self, poses: WindowPoses, near: NearSpheres) -> Rows | None:
        """How deep spheres are in shapes, of those that are `near` and felt in some frame."""
        centers = near.centers(poses)
        beyond = near.beyond(poses, centers)
        depth = near.radii - np.maximum.reduce(beyond)
        felt = depth > -_ACTIVE
        (active,) = np.logical_or.reduce(felt).nonzero()
        if not len(active):
            return None
        depth, felt, near = depth.take(active, axis=1), felt.take(active, axis=1), near.at(active)
        wrenches = np.empty((6, *depth.shape))
        sides = beyond.take(active, axis=2).argmax(axis=0)
        near.polytopes.normals(poses, near.large, sides, out=wrenches[3:])
        # The cross product: x, y and z of both twice, in turn.
        p, n = centers.take(active, axis=2), wrenches[3:]
        p, n = np.concatenate([p, p[:2]]), np.concatenate([n, n[:2]])
        np.subtract(p[1:4] * n[2:], p[2:] * n[1:4], out=wrenches[:3])
        residual, slope = one_sided(depth, DEPTH_ROUNDING)
        slope *= felt
        wrenches *= slope
        weights, moving = self._weights.take(near.pairs), self._moving.take(near.pairs, axis=0)
        residual *= felt * weights
        return Rows(wrenches.transpose(1, 2, 0), moving, residual)


def _moving(
    firm: float, tree: Tree, pairs: Sequence[ShapePair], dofs: WindowDofs
) -> tuple[Float[np.ndarray, "P D"], Float[np.ndarray, "P"]]:
    """Which columns move the pairs together (-1) and apart, of the links that give way, weighted;
    and the weights."""
    moving, weights = np.zeros((len(pairs), tree.nv)), np.full(len(pairs), firm * W_COLLISION)
    for k, pair in enumerate(pairs):
        chains = [tree.chain(part.link) for part in (pair.small, pair.large)]
        both = set(chains[0]) & set(chains[1])
        early = _among(pair, tree, dofs.first_links)
        if early:
            weights[k] = firm * W_LEG_COLLISION
        for sign, chain in zip((-1.0, 1.0), chains, strict=True):
            own = tuple(j for j in chain if j not in both and (j in dofs.first_links) == early)
            moving[k, tree.dofs(own)] = sign
    return moving.take(dofs.numbers, axis=1) * weights[:, None], weights


def _among(pair: ShapePair, tree: Tree, links: set[int]) -> bool:
    """Whether no other links than these move the two."""
    return links.issuperset(tree.chain(pair.small.link) + tree.chain(pair.large.link))


def _bound(shape: Shape) -> float:
    """How far [m] the spheres of a shape reach from its center."""
    away = np.linalg.norm(shape.spheres - shape.center, axis=1)
    return float((away + shape.radii).max())
