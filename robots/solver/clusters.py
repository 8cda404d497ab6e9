"""Small shapes that one link carries, searched together for what they may collide with."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from robots.solver.block import Block
from robots.solver.hulls import Shape, ShapePair
from robots.solver.pushes import Moves


@dataclass(frozen=True, eq=False)
class Cluster:
    """The small shapes of a link, such as a hand and its fingers, and L large ones that they may
    collide with: the pairs of each large one by the small shapes, and the joints that move the
    two sides against each other."""

    link: int
    pairs: tuple[dict[Shape, ShapePair], ...]
    moves: tuple[Moves, ...]

    @cached_property
    def smalls(self) -> tuple[Shape, ...]:
        """The small shapes."""
        return tuple(dict.fromkeys(shape for pairs in self.pairs for shape in pairs))

    @cached_property
    def larges(self) -> tuple[Shape, ...]:
        """The large shapes."""
        return tuple(next(iter(pairs.values())).large for pairs in self.pairs)

    @cached_property
    def spheres(self) -> Float[np.ndarray, "S 3"]:
        """Those of all small shapes [m, rest pose]."""
        return np.concatenate([shape.spheres for shape in self.smalls])

    @cached_property
    def starts(self) -> Int[np.ndarray, "K"]:
        """The first sphere of each small shape."""
        counts = np.array([len(shape.spheres) for shape in self.smalls])
        return np.cumsum(counts) - counts

    @cached_property
    def reach(self) -> Float[np.ndarray, "L S"]:
        """How near [m] the centre of a sphere may come to a large shape: its radius, and
        the pair's clearance; -inf where the two don't collide."""
        nowhere = -np.inf
        rows = [
            [pairs[x].clearance if x in pairs else nowhere for x in self.smalls]
            for pairs in self.pairs
        ]
        counts = [len(shape.spheres) for shape in self.smalls]
        return np.repeat(rows, counts, axis=1) + np.concatenate([x.radii for x in self.smalls])

    @cached_property
    def center(self) -> Float[np.ndarray, "3"]:
        """About the middle of the small shapes [m, rest pose]."""
        centers = np.array([shape.center for shape in self.smalls])
        middle: Float[np.ndarray, 3] = (centers.min(axis=0) + centers.max(axis=0)) / 2
        return middle

    @cached_property
    def away(self) -> Float[np.ndarray, "S"]:
        """How far [m] the spheres' centres are from there."""
        return np.linalg.norm(self.spheres - self.center, axis=1)

    @cached_property
    def bound(self) -> float:
        """How far [m] they reach from there."""
        away = [np.linalg.norm(x.center - self.center) + x.bound for x in self.smalls]
        return float(max(away))


def clusters_of(pairs: Iterable[ShapePair], block: Block) -> list[Cluster]:
    """The pairs that a block moves against each other, by the links of the small ones. While the
    base is free, pairs with joints that are not are left to the block that frees them."""
    found: dict[int, dict[Shape, dict[Shape, ShapePair]]] = {}
    moves: dict[tuple[int, int], Moves] = {}
    for pair in pairs:
        small, large = pair.small.link, pair.large.link
        a, b = block.free_joints(small), block.free_joints(large)
        own = tuple(j for j in a if j not in b), tuple(j for j in b if j not in a)
        later = not (block.frees(small) and block.frees(large))
        if (own[0] or own[1]) and not (block.base and later):
            found.setdefault(small, {}).setdefault(pair.large, {})[pair.small] = pair
            moves[small, large] = own
    return [
        Cluster(link, tuple(by_large.values()), tuple(moves[link, x.link] for x in by_large))
        for link, by_large in found.items()
    ]
