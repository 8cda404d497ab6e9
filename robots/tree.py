"""Forward kinematics of hinges and balls for a whole trajectory at once, and its derivatives.

Everything is told in the rest pose (MuJoCo's `qpos0`): a joint is an axis through an anchor, and a
motion is a product of exponentials (Brockett 1984; Lynch and Park, "Modern Robotics", ch. 4). So
axes need not meet in a point, and no body frames are needed.
Time is the last axis of every array in here: numpy then runs over long contiguous rows.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

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

BASE = 6  # columns of the base: its position, then its rotation, both in world axes
ROOT = -1  # the base as a link


@dataclass(frozen=True, eq=False)
class Tree:
    """Joints with parents before children; joint i moves link i, and -1 is the base.

    `anchors` [m] and `axes` are in the rest pose's world; a ball has three axes, the world's.
    `lower` and `upper` [rad] limit hinges, measured from the rest pose; infinite where unlimited.
    """

    parents: Int[np.ndarray, "N"]
    anchors: Float[np.ndarray, "N 3"]
    axes: Float[np.ndarray, "N 3"]
    balls: Bool[np.ndarray, "N"]
    lower: Float[np.ndarray, "N"]
    upper: Float[np.ndarray, "N"]
    base: Float[np.ndarray, "3"]

    def __len__(self) -> int:
        return len(self.parents)

    @cached_property
    def starts(self) -> Int[np.ndarray, "N"]:
        """The first column of each joint; the base has the first six."""
        widths = np.where(self.balls, 3, 1)
        return BASE + np.cumsum(widths) - widths

    @cached_property
    def size(self) -> int:
        """The number of columns."""
        return BASE + int(np.where(self.balls, 3, 1).sum())

    def within(self, short: float) -> tuple[Float[np.ndarray, "N"], Float[np.ndarray, "N"]]:
        """The limits drawn in by some angle [rad], or by a twentieth of a small range."""
        with np.errstate(invalid="ignore"):
            kept = np.minimum(short, 0.05 * (self.upper - self.lower))
        return self.lower + kept, self.upper - kept

    def chain(self, link: int) -> tuple[int, ...]:
        """The joints from the base out to `link`."""
        joints: list[int] = []
        while link >= 0:
            joints.append(link)
            link = int(self.parents[link])
        return tuple(reversed(joints))

    def columns(self, joints: tuple[int, ...]) -> list[int]:
        """The columns of some joints, in order."""
        return [int(self.starts[j]) + k for j in joints for k in range(3 if self.balls[j] else 1)]


@dataclass(frozen=True, eq=False)
class Coordinates:
    """A trajectory: the base's place and rotation since the rest pose, hinge angles since the rest
    pose [rad] and, where there are balls, their rotations in the parent link (`q_parent_joint`).
    """

    pos: Float[np.ndarray, "T 3"]
    quat: Float[np.ndarray, "T 4"]
    angles: Float[np.ndarray, "T N"]
    turns: Float[np.ndarray, "T N 4"] | None = None

    def __len__(self) -> int:
        return len(self.pos)

    def at_limits(self, tree: Tree, short: float) -> Float[np.ndarray, "T D"]:
        """For each column 1 where its hinge stands `short` [rad] of its upper limit or beyond (less
        where its range is small), -1 at the lower, 0 elsewhere."""
        out = np.zeros((len(self), tree.size))
        hinges = ~tree.balls
        lower, upper = tree.within(short)
        angles = self.angles[:, hinges]
        out[:, tree.starts[hinges]] = (angles >= upper[hinges] - 1e-9) * 1.0 - (
            angles <= lower[hinges] + 1e-9
        )
        return out

    def clipped(self, tree: Tree, short: float) -> "Coordinates":
        """The same with hinges no nearer to their limits than `short` [rad]."""
        lower, upper = tree.within(short)
        angles = np.where(tree.balls, self.angles, np.clip(self.angles, lower, upper))
        return Coordinates(self.pos, self.quat, angles, self.turns)

    def at(self, frames: slice | Int[np.ndarray, "S"]) -> "Coordinates":
        """Those of some frames."""
        turns = None if self.turns is None else self.turns[frames]
        return Coordinates(self.pos[frames], self.quat[frames], self.angles[frames], turns)

    def replaced(self, frames: Int[np.ndarray, "S"], others: "Coordinates") -> "Coordinates":
        """The same but for some frames."""
        pos, quat, angles = self.pos.copy(), self.quat.copy(), self.angles.copy()
        pos[frames], quat[frames], angles[frames] = others.pos, others.quat, others.angles
        turns = None
        if self.turns is not None:
            turns = self.turns.copy()
            turns[frames] = others.turns
        return Coordinates(pos, quat, angles, turns)

    def every(self, stride: int) -> "Coordinates":
        """Those of every `stride`-th frame."""
        return self.at(slice(None, None, stride))

    def between(self, stride: int, frames: int) -> "Coordinates":
        """The cubic splines through these, for `stride` times as many frames."""
        time = np.arange(frames) / stride

        def spline(values: Float[np.ndarray, "K *n"]) -> Float[np.ndarray, "T *n"]:
            return CubicSpline(np.arange(len(values)), values, bc_type="natural")(time)

        turns = self.turns
        return Coordinates(
            spline(self.pos),
            quat_normalize(spline(quat_continuous(self.quat))),
            spline(self.angles),
            None if turns is None else quat_normalize(spline(quat_continuous(turns))),
        )

    def moved(self, tree: Tree, step: Float[np.ndarray, "T D"]) -> "Coordinates":
        """The trajectory after a small step in the tree's columns."""
        hinges = ~tree.balls
        angles = self.angles.copy()
        angles[:, hinges] += step[:, tree.starts[hinges]]
        turns = None
        if self.turns is not None:
            turns = self.turns.copy()
            for j in np.flatnonzero(tree.balls):
                at = tree.starts[j]
                turns[:, j] = quat_mul(quat_from_rotvec(step[:, at : at + 3]), turns[:, j])
        quat = quat_mul(quat_from_rotvec(step[:, 3:6]), self.quat)
        return Coordinates(self.pos + step[:, :3], quat, angles, turns)


@dataclass(frozen=True, eq=False)
class Frames:
    """Where every link is: rotations since the rest pose, and places of the joints' anchors [m].

    The last entry of the arrays is the base, so that index -1 means what it says.
    """

    tree: Tree
    turns: Float[np.ndarray, "L 3 3 T"]
    places: Float[np.ndarray, "L 3 T"]

    def at(self, frames: Int[np.ndarray, "S"], links: Iterable[int] | None = None) -> "Frames":
        """The same in some of the frames; only `links` where they are named."""
        if links is None:
            return Frames(self.tree, self.turns[..., frames], self.places[..., frames])
        turns = np.empty((*self.turns.shape[:-1], len(frames)))
        places = np.empty((*self.places.shape[:-1], len(frames)))
        for link in links:
            turns[link] = self.turns[link][..., frames]
            places[link] = self.places[link][..., frames]
        return Frames(self.tree, turns, places)

    def point(self, link: int, rest: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 T"]:
        """A point of a link, given where it is in the rest pose [m, world]."""
        anchor = self.tree.base if link < 0 else self.tree.anchors[link]
        return self.places[link] + self.direction(link, rest - anchor)

    def direction(self, link: int, rest: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 T"]:
        """A direction that is fixed in a link, given in the rest pose's world."""
        return _apply(self.turns[link], rest)

    def axis(self, joint: int, k: int) -> Float[np.ndarray, "3 T"]:
        """The axis [world] of a joint's column k."""
        parent = int(self.tree.parents[joint])
        if self.tree.balls[joint]:
            return self.turns[parent][:, k]
        return self.direction(parent, self.tree.axes[joint])

    def turn_columns(self, joints: tuple[int, ...]) -> Float[np.ndarray, "C 3 T"]:
        """How fast [1] a link's rotation vector grows with each column of some joints above it."""
        tree = self.tree
        return np.stack(
            [self.axis(j, k) for j in joints for k in range(3 if tree.balls[j] else 1)]
            or [np.zeros((3, self.places.shape[2]))]
        )[: len(tree.columns(joints))]

    def point_columns(
        self,
        joints: tuple[int, ...],
        axes: Float[np.ndarray, "C 3 T"],
        point: Float[np.ndarray, "3 T"],
    ) -> Float[np.ndarray, "C 3 T"]:
        """How fast a point moves with each column of some joints above it; `axes` are theirs."""
        out = np.empty_like(axes)
        row = 0
        for j in joints:
            arm = point - self.places[j]
            for _ in range(3 if self.tree.balls[j] else 1):
                cross(axes[row], arm, out[row])
                row += 1
        return out


def forward(tree: Tree, q: Coordinates) -> Frames:
    """All links in all frames."""
    count, time = len(tree), len(q)
    turns = np.empty((count + 1, 3, 3, time))
    places = np.empty((count + 1, 3, time))
    turns[-1] = np.moveaxis(matrix_from_quat(q.quat), 0, -1)
    places[-1] = q.pos.T
    sin, cos = np.sin(q.angles.T), np.cos(q.angles.T)
    for j, parent in enumerate(tree.parents.tolist()):
        above = turns[parent]
        anchor = tree.base if parent < 0 else tree.anchors[parent]
        places[j] = places[parent] + _apply(above, tree.anchors[j] - anchor)
        if tree.balls[j]:
            assert q.turns is not None
            local = np.moveaxis(matrix_from_quat(q.turns[:, j]), 0, -1)
            turns[j] = np.einsum("ijt,jkt->ikt", above, local)
        else:
            K = skew(tree.axes[j])
            rows = above.transpose(1, 0, 2).reshape(3, -1)  # columns of R, rows and time together
            crossed = (K.T @ rows).reshape(3, 3, time)
            twice = (K.T @ crossed.reshape(3, -1)).reshape(3, 3, time)
            turns[j] = above + (sin[j] * crossed + (1 - cos[j]) * twice).transpose(1, 0, 2)
    return Frames(tree, turns, places)


def _apply(
    turns: Float[np.ndarray, "3 3 T"], v: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "3 T"]:
    return turns[:, 0] * v[0] + turns[:, 1] * v[1] + turns[:, 2] * v[2]


def skew(v: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    """The matrix of the cross product with `v` from the left."""
    x, y, z = v
    return np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])


def cross(
    u: Float[np.ndarray, "3 T"], v: Float[np.ndarray, "3 T"], out: Float[np.ndarray, "3 T"]
) -> None:
    """The cross product, four times as fast as numpy's."""
    np.subtract(u[1] * v[2], u[2] * v[1], out=out[0])
    np.subtract(u[2] * v[0], u[0] * v[2], out=out[1])
    np.subtract(u[0] * v[1], u[1] * v[0], out=out[2])
