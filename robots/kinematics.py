"""Forward kinematics of a tree of hinges and balls, and its Jacobians, for whole trajectories.

A link's pose is a product of exponentials of the joint twists above it (Brockett 1984; Lynch and
Park, "Modern Robotics", ch. 4).

Time is the last axis of the arrays of `LinkPoses` and of the Jacobians: numpy then runs over long
contiguous rows. `Coordinates` has it first, as files and other trajectories do.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from jaxtyping import Float, Int

from robots.tree import Coordinates, Tree
from spark.rotation import matrix_from_quat
from spark.summary import brief


@dataclass(frozen=True, eq=False)
class LinkPoses:
    """Where every link is in every frame: its rotation matrix since the rest pose, and the position
    of its joint's anchor [m, world].

    The arrays have L = N + 1 entries: the last is the base, so that index -1 means what it says.
    """

    tree: Tree
    rotations: Float[np.ndarray, "L 3 3 T"]
    positions: Float[np.ndarray, "L 3 T"]

    __repr__ = brief

    def at(self, frames: Int[np.ndarray, "S"], links: Iterable[int] | None = None) -> "LinkPoses":
        """The same in some of the frames; only `links` where they are named, the rest undefined."""
        if links is None:
            every = (part.take(frames, axis=-1) for part in (self.rotations, self.positions))
            return LinkPoses(self.tree, *every)
        rotations = np.empty((*self.rotations.shape[:-1], len(frames)))
        positions = np.empty((*self.positions.shape[:-1], len(frames)))
        for link in links:
            self.rotations[link].take(frames, axis=-1, out=rotations[link], mode="clip")
            self.positions[link].take(frames, axis=-1, out=positions[link], mode="clip")
        return LinkPoses(self.tree, rotations, positions)

    def point(self, link: int, rest: Float[np.ndarray, "3 *T"]) -> Float[np.ndarray, "3 T"]:
        """The path [m] of a point of a link, or of one a frame, given where it is in the rest pose
        [m, world]."""
        return self.positions[link] + self.direction(link, (rest.T - self.tree.anchor(link)).T)

    def heights(self, link: int, rest: Float[np.ndarray, "P 3"]) -> Float[np.ndarray, "P T"]:
        """How high [m] some points of a link are."""
        arms = rest - self.tree.anchor(link)
        return self.positions[link][2] + arms @ self.rotations[link][2]

    def direction(self, link: int, rest: Float[np.ndarray, "3 *T"]) -> Float[np.ndarray, "3 T"]:
        """A direction that is fixed in a link, given in the rest pose's world."""
        return _apply(self.rotations[link], rest)

    def axis(self, joint: int, k: int) -> Float[np.ndarray, "3 T"]:
        """The axis [world] of a joint's dof k."""
        parent = int(self.tree.parents[joint])
        if self.tree.balls[joint]:
            return self.rotations[parent][:, k]
        return self.direction(parent, self.tree.axes[joint])

    def angular_jacobian(self, joints: tuple[int, ...]) -> Float[np.ndarray, "C 3 T"]:
        """The Jacobian of a link's rotation vector [rad, world] by the C dofs of some joints above
        it: their axes."""
        tree = self.tree
        return np.stack(
            [self.axis(j, k) for j in joints for k in range(3 if tree.balls[j] else 1)]
            or [np.zeros((3, self.positions.shape[2]))]
        )[: len(tree.dofs(joints))]

    def point_jacobian(
        self,
        joints: tuple[int, ...],
        axes: Float[np.ndarray, "C 3 T"],
        point: Float[np.ndarray, "3 T"],
    ) -> Float[np.ndarray, "C 3 T"]:
        """The Jacobian of a link's point [m] by the C dofs [rad] of some joints above it: their
        twists there, axis x (point - anchor); `axes` is their `angular_jacobian`."""
        out = np.empty_like(axes)
        row = 0
        for j in joints:
            arm = point - self.positions[j]
            for _ in range(3 if self.tree.balls[j] else 1):
                cross(axes[row], arm, out[row])
                row += 1
        return out


_POSES: WeakKeyDictionary[Coordinates, LinkPoses] = WeakKeyDictionary()


def forward_kinematics(tree: Tree, q: Coordinates) -> LinkPoses:
    """The poses of all links in all frames; of the same coordinates, which no one may write to from
    then on, they are found once."""
    known = _POSES.get(q)
    if known is None or known.tree is not tree:
        known = _POSES[q] = _forward_kinematics(tree, q)
        for part in (q.pos, q.quat, q.angles, q.ball_quats):
            if part is not None:
                part.flags.writeable = False
    return known


def _forward_kinematics(tree: Tree, q: Coordinates) -> LinkPoses:
    count, time = len(tree), len(q)
    rotations = np.empty((count + 1, 3, 3, time))
    positions = np.empty((count + 1, 3, time))
    rotations[-1] = np.moveaxis(matrix_from_quat(q.quat), 0, -1)
    positions[-1] = q.pos.T
    angles = np.ascontiguousarray(q.angles.T)
    sin, cos = np.sin(angles), np.cos(angles)
    for j, parent in enumerate(tree.parents.tolist()):
        above = rotations[parent]
        arm = tree.anchors[j] - tree.anchor(parent)
        positions[j] = positions[parent] + _apply(above, arm)
        if tree.balls[j]:
            assert q.ball_quats is not None
            local = np.moveaxis(matrix_from_quat(q.ball_quats[:, j]), 0, -1)
            rotations[j] = np.einsum("ijt,jkt->ikt", above, local)
        else:
            _turn(above, tree.axes[j], sin[j], cos[j], rotations[j])
    return LinkPoses(tree, rotations, positions)


def _turn(
    above: Float[np.ndarray, "3 3 T"],
    axis: Float[np.ndarray, "3"],
    sin: Float[np.ndarray, "T"],
    cos: Float[np.ndarray, "T"],
    out: Float[np.ndarray, "3 3 T"],
) -> None:
    """Rotations R after turns about an axis, by Rodrigues' formula: R (1 + sin K + (1 - cos) K²),
    K the axis' cross product matrix. About x, y or z two columns turn into each other."""
    along = np.flatnonzero(axis)
    if len(along) == 1:
        k = int(along[0])
        i, j = (k + 1) % 3, (k + 2) % 3
        sine = sin * axis[k]
        out[:, k] = above[:, k]
        np.multiply(above[:, i], cos, out=out[:, i])
        out[:, i] += above[:, j] * sine
        np.multiply(above[:, j], cos, out=out[:, j])
        out[:, j] -= above[:, i] * sine
        return
    K = skew(axis)
    squared = K @ K
    shares = np.stack([K, -squared, np.eye(3) + squared], axis=2)
    turned = shares.reshape(9, 3) @ np.stack([sin, cos, np.ones_like(sin)])
    np.einsum("ijt,jkt->ikt", above, turned.reshape(3, 3, len(sin)), out=out)


def _apply(
    rotations: Float[np.ndarray, "3 3 T"], v: Float[np.ndarray, "3 *T"]
) -> Float[np.ndarray, "3 T"]:
    # Not by BLAS, whose last bits depend on how many frames there are.
    return rotations[:, 0] * v[0] + rotations[:, 1] * v[1] + rotations[:, 2] * v[2]


def skew(v: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """The matrix of the cross product with `v` from the left."""
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def cross(
    u: Float[np.ndarray, "3 *T"], v: Float[np.ndarray, "3 *T"], out: Float[np.ndarray, "3 *T"]
) -> None:
    """The cross product, four times as fast as numpy's."""
    np.subtract(u[1] * v[2], u[2] * v[1], out=out[0])
    np.subtract(u[2] * v[0], u[0] * v[2], out=out[1])
    np.subtract(u[0] * v[1], u[1] * v[0], out=out[2])
