"""Residuals of poses and how fast they grow: the terms that objectives are made of.

Rows are `C M T`: the M residuals' derivatives by C columns, over T frames, both already weighted.
"""

import numpy as np
from jaxtyping import Float

from robots.tree import Coordinates, Frames, Tree, cross

Rows = tuple[Float[np.ndarray, "C M T"], Float[np.ndarray, "M T"]]


def direction_rows(
    now: Float[np.ndarray, "3 T"],
    wanted: Float[np.ndarray, "3 T"],
    axes: Float[np.ndarray, "C 3 T"],
    weight: float | Float[np.ndarray, "T"],
) -> Rows:
    """A unit vector of a link that should point somewhere: its chord, nearly the angle [rad]."""
    rows = np.empty_like(axes)
    for column, axis in enumerate(axes):
        cross(axis, now, rows[column])
    return rows * weight, (now - wanted) * weight


def turn_rows(
    now: Float[np.ndarray, "3 3 T"],
    wanted: Float[np.ndarray, "3 3 T"],
    axes: Float[np.ndarray, "C 3 T"],
    weight: float | Float[np.ndarray, "T"],
) -> Rows:
    """A link that should be turned some way: it costs 1 - cos of the angle between, whose gradient
    is the sine of that angle about its axis.

    Three residuals are that sine; the fourth, which has no rows, is what of the cost their squares
    lack.
    """
    axial = np.zeros((4, now.shape[2]))
    crossed = np.empty_like(axial[:3])
    for k in range(3):  # the axial vector of now wanted^T
        cross(wanted[:, k], now[:, k], crossed)
        axial[:3] += 0.5 * crossed
    axial[3] = (3.0 - (now * wanted).sum((0, 1))) / 2
    rows = np.zeros((len(axes), 4, now.shape[2]))
    rows[:, :3] = axes * weight
    return rows, axial * weight


def point_columns(
    frames: Frames,
    chain: tuple[int, ...],
    axes: Float[np.ndarray, "C 3 T"],
    point: Float[np.ndarray, "3 T"],
    *,
    base: bool,
) -> Float[np.ndarray, "K 3 T"]:
    """How fast a point of a link moves with the columns of a chain of joints; `axes` are theirs.

    With `base` the base's six come before them, and its three axes before theirs.
    """
    if not base:
        return frames.point_columns(chain, axes, point)
    columns = np.empty((3 + len(axes), 3, point.shape[1]))
    columns[:3] = np.eye(3)[:, :, None]
    arm = point - frames.places[-1]
    for k in range(3):
        cross(axes[k], arm, columns[3 + k])
    columns[6:] = frames.point_columns(chain, axes[3:], point)
    return columns


def one_sided(
    over: Float[np.ndarray, "*n"], ease: float | Float[np.ndarray, "*n"]
) -> tuple[Float[np.ndarray, "*n"], Float[np.ndarray, "*n"]]:
    """A residual that grows with what is over zero, and its slope; bent over a width of `ease`.

    A sharp bend would let Gauss-Newton step over it back and forth.
    """
    root = np.sqrt(over**2 + ease**2)
    return (root + over) / 2, (1 + over / root) / 2


def limit_rows(
    tree: Tree, q: Coordinates, *, margin: float, weight: float
) -> tuple[Float[np.ndarray, "T D"], Float[np.ndarray, "T D"]]:
    """Hinges nearer than `margin` [rad] to a limit (less where the range is small): a residual for
    each column, and how fast it grows with that column."""
    rows, residuals = np.zeros((2, len(q), tree.size))
    hinges = ~tree.balls
    at = tree.starts[hinges]
    lower, upper = tree.lower[hinges], tree.upper[hinges]
    near = np.minimum(margin, 0.1 * (upper - lower))
    angles = q.angles[:, hinges]
    above, rising = one_sided(angles - (upper - near), margin / 4)
    below, falling = one_sided(lower + near - angles, margin / 4)
    rows[:, at] = weight * (rising + falling)
    residuals[:, at] = weight * (above - below)
    return residuals, rows
