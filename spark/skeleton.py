"""A skeleton: named joints in a tree, in SI units and Z-up axes."""

from collections.abc import Container
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from spark.errors import SkeletonError
from spark.summary import counted


@dataclass(frozen=True, eq=False)
class Skeleton:
    """Joints with parents before children; joint 0 is the root.

    In the rest pose every joint's axes are parallel to the world's: a joint's rest rotation is the
    identity and `offsets` are at once local and world vectors [m]. `ends` are the End Sites (toe
    tip, crown, finger tips): points fixed to a joint, without a rotation of their own.
    `translating` marks the joints whose position the file animates; the root always is one.
    """

    names: tuple[str, ...]
    parents: Int[np.ndarray, "J"]
    offsets: Float[np.ndarray, "J 3"]
    translating: Bool[np.ndarray, "J"]
    end_parents: Int[np.ndarray, "E"] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    end_offsets: Float[np.ndarray, "E 3"] = field(default_factory=lambda: np.zeros((0, 3)))

    def __repr__(self) -> str:
        return f"Skeleton({counted(len(self), 'joint')} from {self.names[0]!r})"

    def __post_init__(self) -> None:
        if not self.names:
            raise SkeletonError("a skeleton needs at least one joint")
        if self.parents[0] != -1:
            raise SkeletonError(f"joint 0 ({self.names[0]!r}) must be the root, with parent -1")
        for j, parent in enumerate(self.parents[1:].tolist(), start=1):
            if not 0 <= parent < j:
                raise SkeletonError(
                    f"joint {j} ({self.names[j]!r}) has parent {parent}: expected 0 to {j - 1}, "
                    "parents come before their children and there is one root"
                )

    def __len__(self) -> int:
        return len(self.names)

    @cached_property
    def children(self) -> tuple[tuple[int, ...], ...]:
        """Child joints of each joint, in order."""
        lists: list[list[int]] = [[] for _ in self.names]
        for j, parent in enumerate(self.parents[1:].tolist(), start=1):
            lists[parent].append(j)
        return tuple(map(tuple, lists))

    @cached_property
    def levels(self) -> tuple[Int[np.ndarray, "_"], ...]:
        """Joints by depth, the root's level first: what forward kinematics walks over."""
        depth = np.zeros(len(self), dtype=np.int64)
        for j, parent in enumerate(self.parents[1:].tolist(), start=1):
            depth[j] = depth[parent] + 1
        return tuple(np.flatnonzero(depth == d) for d in range(int(depth.max()) + 1))

    def upper(self, joints: Int[np.ndarray, "K"]) -> "Skeleton":
        """Some joints, in order, and with each all that are above it; without End Sites."""
        names, above = tuple(self.names[j] for j in joints), self.parents[joints[1:]]
        parents = np.append(-1, np.searchsorted(joints, above))
        return Skeleton(names, parents, self.offsets[joints], self.translating[joints])

    @cached_property
    def rest_positions(self) -> Float[np.ndarray, "J 3"]:
        """Joint positions [m] in the rest pose, the root at its own offset."""
        positions = self.offsets.copy()
        for level in self.levels[1:]:
            positions[level] += positions[self.parents[level]]
        return positions

    def ancestors(self, joint: int) -> tuple[int, ...]:
        """`joint`, its parent, ... up to the root."""
        chain = [joint]
        while (joint := int(self.parents[joint])) >= 0:
            chain.append(joint)
        return tuple(chain)

    def above(self, joint: int, among: Container[int]) -> int:
        """The nearest joint of `among` above `joint`; -1 where there is none."""
        return next((j for j in self.ancestors(joint)[1:] if j in among), -1)

    def subtree(self, joint: int) -> tuple[int, ...]:
        """`joint` and everything below it, parents first."""
        inside = {joint}
        for j in range(joint + 1, len(self)):
            if int(self.parents[j]) in inside:
                inside.add(j)
        return tuple(sorted(inside))
