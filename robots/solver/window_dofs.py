"""The dofs that a few frames are solved for, and which of them move what."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int

from robots.model.morphology import Morphology
from robots.solver.block import blocks_of
from robots.tree import BASE


class WindowDofs:
    """A robot's, or those of `only` some joints of the later block: arms and head hang on base,
    trunk and legs, and don't move them. `numbers` are those of `robots.tree`, `mj` MuJoCo's."""

    def __init__(self, robot: Morphology, *, only: Sequence[int] | None = None) -> None:
        self._robot, self.later_only = robot, only is not None
        model, tree = robot.mjcf.model, robot.tree
        first, _ = blocks_of(robot)
        self._in_first_block = np.zeros(len(tree) + 1, dtype=bool)  # of the links, and -1
        self._in_first_block[[*first.joints, -1]] = True
        self.first_links = set(np.flatnonzero(self._in_first_block[:-1]).tolist())
        dofs = range(tree.nv) if only is None else tree.dofs(tuple(only))
        self.numbers = np.array(dofs, dtype=int)
        links = np.repeat(np.arange(len(tree)), np.where(tree.balls, 3, 1))
        starts = model.jnt_dofadr[np.array(robot.mj_joints, dtype=int)[links]]
        base = robot.mjcf.base_dof + np.arange(BASE)
        within = np.arange(BASE, tree.nv) - tree.dof_starts[links]
        self.mj = np.append(base, starts + within)[self.numbers]

    def __len__(self) -> int:
        return len(self.numbers)

    def bodies(self, links: Sequence[int]) -> Int[np.ndarray, "K"]:
        """The bodies of some links; of -1 the base."""
        robot = self._robot
        joints = [robot.mj_joints[link] if link >= 0 else -1 for link in links]
        of_joints = np.append(robot.mjcf.model.jnt_bodyid, robot.mjcf.root)
        return np.asarray(of_joints[np.array(joints, dtype=int)], dtype=np.int64)

    def in_first_block(self, links: Sequence[int]) -> Bool[np.ndarray, "K"]:
        """Which of some links base, trunk and legs move alone."""
        return self._in_first_block[np.array(links, dtype=int)]

    def moving(
        self, links: Sequence[int], first: Bool[np.ndarray, "K"] | None = None
    ) -> Float[np.ndarray, "K D"]:
        """1 for the dofs that move some links, of the first block or the later one: by default that
        which they are in."""
        tree = self._robot.tree
        first = self.in_first_block(links) if first is None else first
        out = np.zeros((len(links), tree.nv))
        for k, link in enumerate(links):
            out[k, :BASE] = first[k]
            same = [j for j in tree.chain(link) if self._in_first_block[j] == first[k]]
            out[k, tree.dofs(tuple(same))] = 1.0
        return out.take(self.numbers, axis=1)


def as_slice(numbers: Int[np.ndarray, "K"]) -> slice | Int[np.ndarray, "K"]:
    """The same as a slice where they follow each other: a view is picked in a fraction of a
    microsecond, a copy in three."""
    start = int(numbers[0]) if len(numbers) else 0
    found = slice(start, start + len(numbers))
    return found if (numbers == np.arange(found.start, found.stop)).all() else numbers
