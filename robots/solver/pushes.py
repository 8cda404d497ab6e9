"""What pushes two parts of a robot apart: all residuals of the pairs that the same joints move."""

import numpy as np
from jaxtyping import Float, Int

from robots.least_squares import NormalEquations
from robots.residuals import twists
from robots.solver.block import Block
from robots.tree import ROOT, LinkPoses, cross

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
        frames = poses.positions.shape[2] if normal.with_jacobian else 0
        self._squares, self._sums = np.zeros((frames, 6, 6)), np.zeros((frames, 6))
        self._touched = np.zeros(frames, dtype=bool)

    def add(
        self,
        frames: Int[np.ndarray, "N"],
        points: Float[np.ndarray, "3 M N"],
        pushes: Float[np.ndarray, "3 M N"],
        residuals: Float[np.ndarray, "M N"],
    ) -> None:
        """M residuals in some frames: where they push [m, world], along what vector, as long as the
        residual changes with the way along it [1/m]."""
        wrenches = np.empty((6, *residuals.shape))
        base = self._poses.positions[ROOT][:, None, frames]
        cross(points - base, pushes, wrenches[:3])
        wrenches[3:] = pushes
        across = wrenches.transpose(2, 0, 1)
        self._squares[frames] += across @ wrenches.transpose(2, 1, 0)
        self._sums[frames] += (across @ residuals.T[:, :, None])[:, :, 0]
        self._touched[frames] = True

    def add_to_normal(self, block: Block) -> None:
        """Into the block's normal equations; the residuals' cost is not among it."""
        frames = np.flatnonzero(self._touched)
        if not len(frames):
            return
        tree, (yielding, other) = self._poses.tree, self._moves
        joints = yielding + other
        links = {ROOT, *joints, *(int(tree.parents[j]) for j in joints)}
        poses = self._poses.at(frames, links)
        moved = twists(poses, joints, poses.positions[ROOT], base=False)
        moved[:, : len(tree.dofs(yielding))] *= -1.0
        dofs = block.local_joint_dofs(joints)
        self._normal.add_moved(frames, dofs, moved, self._squares[frames], self._sums[frames])
