"""Residuals of poses and their Jacobians: the terms that objectives are sums of.

The cost of a term is half the sum of its squared residuals. A residual r is weighted, so it has no
unit; the weight's unit is one over that of what it weighs: 1/rad for angles and unit vectors'
chords, 1/m for lengths. A Jacobian is stored transposed, `C M T`: the derivatives of M residuals by
C degrees of freedom (dofs; `robots.tree.Tree`) in T frames, weighted as the residuals are.

`axes` [C 3 T] are the world axes of the dofs that turn a link, its `angular_jacobian`.
"""

import numpy as np
from jaxtyping import Float

from robots.kinematics import LinkPoses, cross
from robots.tree import Coordinates, Tree

Linearized = tuple[Float[np.ndarray, "C M T"], Float[np.ndarray, "M T"]]
"""The transposed Jacobian of some residuals, and these."""


def direction_residual(
    direction: Float[np.ndarray, "3 T"],
    target: Float[np.ndarray, "3 T"],
    axes: Float[np.ndarray, "C 3 T"],
    weight: float | Float[np.ndarray, "T"],
) -> Linearized:
    """A unit vector d that is fixed in a link should be d*: r = w (d - d*), dr/dq = w axis x d.

    |d - d*| is the chord of the angle between them, 2 sin(angle / 2); the weight [1/rad].
    """
    jacobian = np.empty_like(axes)
    for dof, axis in enumerate(axes):
        cross(axis, direction, jacobian[dof])
    return jacobian * weight, (direction - target) * weight


def rotation_residual(
    rotation: Float[np.ndarray, "3 3 T"],
    target: Float[np.ndarray, "3 3 T"],
    axes: Float[np.ndarray, "C 3 T"],
    weight: float | Float[np.ndarray, "T"],
) -> Linearized:
    """A link's rotation R should be R*: the cost is w² (1 - cos a), a the angle of R R*'.

    r = w (sin(a) n, 1 - cos a), n the unit axis of R R*': four residuals. The Jacobian is that at
    a = 0, w (axis, 0), with which J'r is the cost's exact gradient at any a. The weight [1/rad].
    """
    residual = np.zeros((4, rotation.shape[2]))
    crossed = np.empty_like(residual[:3])
    for k in range(3):  # sin(a) n is half the sum of these, over the axes of R* and R
        cross(target[:, k], rotation[:, k], crossed)
        residual[:3] += 0.5 * crossed
    residual[3] = (3.0 - (rotation * target).sum((0, 1))) / 2
    jacobian = np.zeros((len(axes), 4, rotation.shape[2]))
    jacobian[:, :3] = axes * weight
    return jacobian, residual * weight


def turning_axes(
    poses: LinkPoses, chain: tuple[int, ...], *, base: bool
) -> Float[np.ndarray, "C 3 T"]:
    """The axes of a chain of joints and, with `base`, the base's three before them."""
    axes = poses.angular_jacobian(chain)
    if not base:
        return axes
    return np.concatenate([np.broadcast_to(np.eye(3)[:, :, None], (3, *axes.shape[1:])), axes])


def point_jacobian(
    poses: LinkPoses,
    chain: tuple[int, ...],
    axes: Float[np.ndarray, "C 3 T"],
    point: Float[np.ndarray, "3 T"],
    *,
    base: bool,
) -> Float[np.ndarray, "K 3 T"]:
    """The Jacobian of a link's point [m] by the dofs of a chain of joints.

    With `base` the base's six dofs come first (K = C + 3: its shifts have no axis), and `axes`
    begin with its three.
    """
    if not base:
        return poses.point_jacobian(chain, axes, point)
    jacobian = np.empty((3 + len(axes), 3, point.shape[1]))
    jacobian[:3] = np.eye(3)[:, :, None]
    arm = point - poses.positions[-1]
    for k in range(3):
        cross(axes[k], arm, jacobian[3 + k])
    jacobian[6:] = poses.point_jacobian(chain, axes[3:], point)
    return jacobian


def twists(
    poses: LinkPoses,
    chain: tuple[int, ...],
    about: Float[np.ndarray, "3 T"],
    *,
    base: bool,
) -> Float[np.ndarray, "T K 6"]:
    """How each dof of a chain of joints, and with `base` the base's six before them, moves what is
    beyond it: its turn [rad, world], and the shift [m] of the point `about` of it.

    A point p then moves along a unit vector n as the twist's product with the wrench
    ((p - about) x n, n) says (Lynch and Park, "Modern Robotics", ch. 3).
    """
    axes = turning_axes(poses, chain, base=base)
    shifts = point_jacobian(poses, chain, axes, about, base=base)
    out = np.zeros((about.shape[1], len(shifts), 6))
    out[:, len(shifts) - len(axes) :, :3] = axes.transpose(2, 0, 1)
    out[:, :, 3:] = shifts.transpose(2, 0, 1)
    return out


def one_sided(
    excess: Float[np.ndarray, "*n"], width: float | Float[np.ndarray, "*#n"]
) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
    """max(excess, 0), rounded over `width` (both in the same unit), and its derivative.

    r = (x + sqrt(x² + width²)) / 2. The kink of the maximum itself would let Gauss-Newton step over
    it back and forth.
    """
    root = np.sqrt(excess**2 + width**2)
    return (root + excess) / 2, (1 + excess / root) / 2


def limit_residual(
    tree: Tree, q: Coordinates, *, margin: float, weight: float
) -> tuple[Float[np.ndarray, "T D"], Float[np.ndarray, "T D"]]:
    """Hinges should keep `margin` [rad] from their limits: a residual for each dof, and its
    derivative by that dof.

    r = w (one_sided(angle - (upper - m)) - one_sided(lower + m - angle)), m the margin or a tenth
    of a small range, rounded over a quarter of `margin`. The weight [1/rad].
    """
    derivatives, residuals = np.zeros((2, len(q), tree.nv))
    hinges = ~tree.balls
    at = tree.dof_starts[hinges]
    lower, upper = tree.lower[hinges], tree.upper[hinges]
    m = np.minimum(margin, 0.1 * (upper - lower))
    angles = q.angles[:, hinges]
    above, rising = one_sided(angles - (upper - m), margin / 4)
    below, falling = one_sided(lower + m - angles, margin / 4)
    derivatives[:, at] = weight * (rising + falling)
    residuals[:, at] = weight * (above - below)
    return residuals, derivatives
