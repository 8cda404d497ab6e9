"""Which part of a robot's coordinates is solved for at a time."""

from dataclasses import dataclass
from functools import cached_property

from robots.tree import BASE, Tree


@dataclass(frozen=True)
class Stage:
    """Part of the columns: those that are solved for while the others are given.

    `joints` are the tree's joints, in order; `base` says whether the base is free, too.
    """

    tree: Tree
    joints: tuple[int, ...]
    base: bool

    @cached_property
    def columns(self) -> list[int]:
        """The tree's columns that are the stage's."""
        return self._of(self.joints)

    def local(self, joints: tuple[int, ...]) -> list[int]:
        """Where the columns of some joints, and the base's if it is free, are among the stage's."""
        return [self.columns.index(column) for column in self._of(joints)]

    def free(self, link: int) -> tuple[int, ...]:
        """The free joints on the way to a link."""
        return tuple(j for j in self.tree.chain(link) if j in self._free)

    def moves(self, link: int) -> bool:
        """Whether all joints on the way to a link are free."""
        return len(self.free(link)) == len(self.tree.chain(link))

    def turning(self, joints: tuple[int, ...]) -> list[int]:
        """Where the columns of some joints are among the stage's."""
        return [self.columns.index(column) for column in self.tree.dofs(joints)]

    @cached_property
    def _free(self) -> frozenset[int]:
        return frozenset(self.joints)

    def _of(self, joints: tuple[int, ...]) -> list[int]:
        return [*(range(BASE) if self.base else ()), *self.tree.dofs(joints)]
