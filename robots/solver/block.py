"""Block coordinate descent: which part of a robot's coordinates is solved for at a time."""

from dataclasses import dataclass
from functools import cached_property

from robots.model.morphology import Morphology
from robots.tree import BASE, ROOT, Tree


@dataclass(frozen=True)
class Block:
    """The degrees of freedom (dofs) that are solved for while the others are given.

    `joints` are the tree's joints that are free, in order; `base` says whether the base is; no
    block frees the `idle` ones.
    """

    tree: Tree
    joints: tuple[int, ...]
    base: bool
    idle: frozenset[int] = frozenset()

    @cached_property
    def dofs(self) -> list[int]:
        """The tree's dofs that are free."""
        return self._dofs_of(self.joints)

    def local_dofs(self, joints: tuple[int, ...]) -> list[int]:
        """The indices, among the block's dofs, of those of some joints, and of the base's before
        them if it is free."""
        return [self.dofs.index(dof) for dof in self._dofs_of(joints)]

    def local_joint_dofs(self, joints: tuple[int, ...]) -> list[int]:
        """The indices, among the block's dofs, of those of some joints."""
        return [self.dofs.index(dof) for dof in self.tree.dofs(joints)]

    def free_joints(self, link: int) -> tuple[int, ...]:
        """The free joints on the way from the base to a link."""
        return tuple(j for j in self.tree.chain(link) if j in self._free)

    def frees(self, link: int) -> bool:
        """Whether all joints on the way from the base to a link are free, but for idle ones."""
        return all(j in self._free or j in self.idle for j in self.tree.chain(link))

    @cached_property
    def _free(self) -> frozenset[int]:
        return frozenset(self.joints)

    def _dofs_of(self, joints: tuple[int, ...]) -> list[int]:
        return [*(range(BASE) if self.base else ()), *self.tree.dofs(joints)]


def carriers(robot: Morphology) -> list[int]:
    """What carries each of the tree's links: itself or, where no block moves its joint, what
    carries the link above it; `ROOT` for the base."""
    out: list[int] = []
    for link, above in enumerate(robot.tree.parents.tolist()):
        out.append(link if link in robot.moved else (out[above] if above >= 0 else ROOT))
    return out


def blocks_of(robot: Morphology) -> tuple[Block, Block]:
    """Base, trunk and legs; then arms and head. Of a robot without legs all at once. Joints beyond
    the last part with a role, as those of grippers, stay as in the T-pose."""
    tree, moved = robot.tree, sorted(robot.moved)
    idle = frozenset(range(len(tree))) - robot.moved
    if robot.mount is not None:
        return Block(tree, (), False, idle), Block(tree, tuple(moved), False, idle)
    links = robot.foot_links | {int(robot.links[robot.rig.chest])}
    first = sorted({j for link in links for j in tree.chain(link)})
    rest = tuple(j for j in moved if j not in first)
    return Block(tree, tuple(first), True, idle), Block(tree, rest, False, idle)


def whole_of(robot: Morphology) -> Block:
    """Both blocks at once."""
    first, rest = blocks_of(robot)
    joints = tuple(sorted(first.joints + rest.joints))
    return Block(robot.tree, joints, first.base, first.idle)
