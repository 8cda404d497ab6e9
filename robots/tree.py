"""A tree of hinges and balls, and trajectories of its coordinates.

Everything is given in the rest pose (MuJoCo's `qpos0`): a joint is an axis through an anchor. So
axes need not meet in a point, and no body frames are needed.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.interpolate import CubicSpline

from spark.rotation import quat_continuous, quat_from_rotvec, quat_mul, quat_normalize
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

    def rest_balls(self, frames: int) -> Float[np.ndarray, "T N 4"] | None:
        """The balls' rotations in the rest pose, in each of some frames; None without balls."""
        return np.tile([1.0, 0, 0, 0], (frames, len(self), 1)) if self.balls.any() else None

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

    def room(self, tree: Tree, margin: float) -> Float[np.ndarray, "2 T D"]:
        """The least and the largest step of each dof [rad] after which its hinge is at least
        `margin` [rad] from its limits; of others without bounds."""
        out = np.full((2, len(self), tree.nv), np.inf)
        out[0] = -np.inf
        hinges = ~tree.balls
        for own, limits in zip(out, tree.limits_within(margin), strict=True):
            own[:, tree.dof_starts[hinges]] = (limits - self.angles)[:, hinges]
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


def one_after_another(parts: Sequence[Coordinates]) -> Coordinates:
    """Some trajectories as one."""
    balls = [part.ball_quats for part in parts if part.ball_quats is not None]
    return Coordinates(
        np.concatenate([part.pos for part in parts]),
        np.concatenate([part.quat for part in parts]),
        np.concatenate([part.angles for part in parts]),
        np.concatenate(balls) if balls else None,
    )
