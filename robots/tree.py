"""Forward kinematics of a tree of hinges and balls, and its Jacobians, for whole trajectories.

Everything is given in the rest pose (MuJoCo's `qpos0`): a joint is an axis through an anchor, and a
link's pose is a product of exponentials of the joint twists above it (Brockett 1984; Lynch and
Park, "Modern Robotics", ch. 4). So axes need not meet in a point, and no body frames are needed.

Time is the last axis of the arrays of `LinkPoses` and of the Jacobians: numpy then runs over long
contiguous rows. `Coordinates` has it first, as files and other trajectories do.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.interpolate import CubicSpline

from spark.rotation import (
    matrix_from_quat,
    quat_continuous,
    quat_from_rotvec,
    quat_mul,
    quat_normalize,
)
from spark.summary import brief

BASE = 6  # degrees of freedom of the base: a shift [m], then a rotation vector [rad], world axes
ROOT = -1  # the base's number as a link


@dataclass(frozen=True, eq=False)
class Tree:
    """Joints with parents before children; joint i moves link i, and -1 is the base.

    `anchors` [m] and unit `axes` are in the rest pose's world; a ball has three axes, the world's.
    `lower` and `upper` [rad] limit hinges, measured from the rest pose; infinite where unlimited.
    `base` [m] is the place of the base in the rest pose.

    A small change of the coordinates is a vector of `nv` degrees of freedom (dofs): six of the
    base, then one a hinge [rad] and three a ball (a rotation vector [rad] in the parent's axes).
    """

    parents: Int[np.ndarray, "N"]
    anchors: Float[np.ndarray, "N 3"]
    axes: Float[np.ndarray, "N 3"]
    balls: Bool[np.ndarray, "N"]
    lower: Float[np.ndarray, "N"]
    upper: Float[np.ndarray, "N"]
    base: Float[np.ndarray, "3"]

    __repr__ = brief

    def __len__(self) -> int:
        return len(self.parents)

    @cached_property
    def dof_starts(self) -> Int[np.ndarray, "N"]:
        """The first dof of each joint; the base has the first six."""
        widths = np.where(self.balls, 3, 1)
        return BASE + np.cumsum(widths) - widths

    @cached_property
    def nv(self) -> int:
        """The number of dofs (MuJoCo's nv)."""
        return BASE + int(np.where(self.balls, 3, 1).sum())

    @cached_property
    def _chains(self) -> dict[int, tuple[int, ...]]:
        out: dict[int, tuple[int, ...]] = {ROOT: ()}
        for j, parent in enumerate(self.parents.tolist()):
            out[j] = (*out[parent], j)
        return out

    @cached_property
    def middle(self) -> Float[np.ndarray, "N"]:
        """Each hinge's angle [rad] in the middle of its limits; 0 without them, and of balls."""
        bounded = np.isfinite(self.lower) & np.isfinite(self.upper) & ~self.balls
        lower, upper = (np.where(bounded, limit, 0.0) for limit in (self.lower, self.upper))
        return (lower + upper) / 2

    def anchor(self, link: int) -> Float[np.ndarray, "3"]:
        """Of a link's joint, or the base's place, in the rest pose [m]."""
        return self.base if link < 0 else self.anchors[link]

    def limits_within(self, margin: float) -> tuple[Float[np.ndarray, "N"], Float[np.ndarray, "N"]]:
        """Lower and upper limits drawn in by `margin` [rad], or by 1/20 of a small range."""
        with np.errstate(invalid="ignore"):
            kept = np.minimum(margin, 0.05 * (self.upper - self.lower))
        return self.lower + kept, self.upper - kept

    def chain(self, link: int) -> tuple[int, ...]:
        """The joints from the base out to `link`."""
        return self._chains[link]

    def dofs(self, joints: tuple[int, ...]) -> list[int]:
        """The dofs of some joints, in order."""
        return [
            int(self.dof_starts[j]) + k for j in joints for k in range(3 if self.balls[j] else 1)
        ]


@dataclass(frozen=True, eq=False)
class Coordinates:
    """A trajectory of T frames, all since the rest pose: the base's position [m] and rotation, the
    hinges' angles [rad] and, where there are balls, their rotations in the parent link
    (`q_parent_joint`, wxyz); a joint's entry in the other kind's array is meaningless.
    """

    pos: Float[np.ndarray, "T 3"]
    quat: Float[np.ndarray, "T 4"]
    angles: Float[np.ndarray, "T N"]
    ball_quats: Float[np.ndarray, "T N 4"] | None = None

    __repr__ = brief

    def __len__(self) -> int:
        return len(self.pos)

    def at_limits(self, tree: Tree, margin: float) -> Float[np.ndarray, "T D"]:
        """For each dof +1 where its hinge is within `margin` [rad] of its upper limit (less where
        its range is small), -1 at the lower limit, 0 elsewhere."""
        out = np.zeros((len(self), tree.nv))
        hinges = ~tree.balls
        lower, upper = tree.limits_within(margin)
        angles = self.angles[:, hinges]
        out[:, tree.dof_starts[hinges]] = (angles >= upper[hinges] - 1e-9) * 1.0 - (
            angles <= lower[hinges] + 1e-9
        )
        return out

    def clipped(self, tree: Tree, margin: float) -> "Coordinates":
        """The same with hinges at least `margin` [rad] from their limits."""
        lower, upper = tree.limits_within(margin)
        angles = np.where(tree.balls, self.angles, np.clip(self.angles, lower, upper))
        return Coordinates(self.pos, self.quat, angles, self.ball_quats)

    def at(self, frames: slice | Int[np.ndarray, "S"]) -> "Coordinates":
        """Those of some frames."""
        balls = None if self.ball_quats is None else self.ball_quats[frames]
        return Coordinates(self.pos[frames], self.quat[frames], self.angles[frames], balls)

    def replaced(self, frames: Int[np.ndarray, "S"], others: "Coordinates") -> "Coordinates":
        """The same with some frames taken from `others`."""
        pos, quat, angles = self.pos.copy(), self.quat.copy(), self.angles.copy()
        pos[frames], quat[frames], angles[frames] = others.pos, others.quat, others.angles
        balls = None
        if self.ball_quats is not None:
            balls = self.ball_quats.copy()
            balls[frames] = others.ball_quats
        return Coordinates(pos, quat, angles, balls)

    def with_joints(self, joints: Sequence[int], others: "Coordinates") -> "Coordinates":
        """The same with some joints turned as in `others`."""
        at, balls = list(joints), self.ball_quats
        angles = self.angles.copy()
        angles[:, at] = others.angles[:, at]
        if balls is not None and others.ball_quats is not None:
            balls = balls.copy()
            balls[:, at] = others.ball_quats[:, at]
        return Coordinates(self.pos, self.quat, angles, balls)

    def every(self, stride: int) -> "Coordinates":
        """Those of every `stride`-th frame."""
        return self.at(slice(None, None, stride))

    def upsampled(self, stride: int, frames: int) -> "Coordinates":
        """The inverse of `every`: natural cubic splines through these, at `frames` frames."""
        if stride == 1:
            return self
        time = np.arange(frames) / stride

        def spline(values: Float[np.ndarray, "K *n"]) -> Float[np.ndarray, "T *n"]:
            return CubicSpline(np.arange(len(values)), values, bc_type="natural")(time)

        balls = self.ball_quats
        return Coordinates(
            spline(self.pos),
            quat_normalize(spline(quat_continuous(self.quat))),
            spline(self.angles),
            None if balls is None else quat_normalize(spline(quat_continuous(balls))),
        )

    def integrated(self, tree: Tree, step: Float[np.ndarray, "T D"]) -> "Coordinates":
        """The trajectory after a small step in the tree's dofs (MuJoCo's mj_integratePos):
        rotations by the exponential map, from the left."""
        hinges = ~tree.balls
        angles = self.angles.copy()
        angles[:, hinges] += step[:, tree.dof_starts[hinges]]
        balls = None
        if self.ball_quats is not None:
            balls = self.ball_quats.copy()
            for j in np.flatnonzero(tree.balls):
                at = tree.dof_starts[j]
                balls[:, j] = quat_mul(quat_from_rotvec(step[:, at : at + 3]), balls[:, j])
        quat = quat_mul(quat_from_rotvec(step[:, 3:6]), self.quat)
        return Coordinates(self.pos + step[:, :3], quat, angles, balls)


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
