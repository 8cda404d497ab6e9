"""What pushes two parts of a robot apart: all residuals of the pairs that the same joints move."""

import numpy as np
from jaxtyping import Float, Int

from robots.kinematics import LinkPoses, cross
from robots.least_squares import NormalEquations
from robots.residuals import twists
from robots.solver.block import Block
from robots.tree import ROOT

Moves = tuple[tuple[int, ...], tuple[int, ...]]
"""The free joints that move one part but not the other, and the reverse."""


class Pushes:
    """Weighted residuals that fall where one part yields to pushes, and the other to the opposite
    ones; `moves` are the joints that move these parts against each other.

    A residual's Jacobian is the joints' twists times its wrench, about the base's place. So however
    many residuals there are, a matrix of 6 x 6 a frame says it all (`NormalEquations.add_moved`).
    """

    def __init__(self, normal: NormalEquations, poses: LinkPoses, moves: Moves) -> None:
        self._normal, self._poses, self._moves = normal, poses, moves
        self._parts: list[tuple[Int[np.ndarray, N], Float[np.ndarray, "7 N"]]] = []

    def add(
        self,
        frames: Int[np.ndarray, "N"],
        points: Float[np.ndarray, "3 N"],
        pushes: Float[np.ndarray, "3 N"],
        residuals: Float[np.ndarray, "N"],
    ) -> None:
        """A residual in each of some frames: where it pushes [m, world], along what vector, as long
        as the residual changes with the way along it [1/m]."""
        rows = np.empty((7, len(frames)))
        cross(points - self._poses.positions[ROOT].take(frames, axis=1), pushes, rows[:3])
        rows[3:6], rows[6] = pushes, residuals
        self._parts.append((frames, rows))

    def add_to_normal(self, block: Block) -> None:
        """Into the block's normal equations; the residuals' cost is not among it."""
        if not self._parts:
            return
        frames, squares, sums = self._by_frame()
        tree, (yielding, other) = self._poses.tree, self._moves
        joints = yielding + other
        links = {ROOT, *joints, *(int(tree.parents[j]) for j in joints)}
        poses = self._poses.at(frames, links)
        moved = twists(poses, joints, poses.positions[ROOT], base=False)
        moved[:, : len(tree.dofs(yielding))] *= -1.0
        dofs = block.local_joint_dofs(joints)
        self._normal.add_moved(frames, dofs, moved, squares, sums)

    def _by_frame(
        self,
    ) -> tuple[Int[np.ndarray, "S"], Float[np.ndarray, "S 6 6"], Float[np.ndarray, "S 6"]]:
        """The frames with residuals, and the sums there of the wrenches' squares, and of these
        times the residuals."""
        frames = np.concatenate([frames for frames, _ in self._parts])
        order = np.argsort(frames, kind="stable")
        rows = np.concatenate([rows for _, rows in self._parts], axis=1).take(order, axis=1)
        frames = frames[order]
        starts = np.flatnonzero(np.diff(frames, prepend=-1))
        first, second = np.triu_indices(7)
        products = np.add.reduceat(rows[first] * rows[second], starts, axis=1)
        whole = np.empty((len(starts), 7, 7))
        whole[:, first, second] = whole[:, second, first] = products.T
        return frames[starts], np.ascontiguousarray(whole[:, :6, :6]), whole[:, :6, 6]
