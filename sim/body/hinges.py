"""Rotations as the angles of three hinges in a row."""

from itertools import product

import numpy as np
from jaxtyping import Float, Int

from spark.rotation import (
    euler_from_quat,
    quat_from_matrix,
    quat_from_rotvec,
    quat_mul,
    quat_relative,
)

_JUMP = 0.3  # [rad] between frames, above which another way through is looked for
_TURN = 2 * np.pi
_STEP = 1.0  # the cost of a squared step between frames, in squared excesses of a frame


def hinge_angles(
    q: Float[np.ndarray, "*n 4"], axes: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "*n 3"]:
    """The angles [rad] with which `R(axes[0]) R(axes[1]) R(axes[2])` is the rotation.

    The second unit axis stands square on the other two, which may stand askew to each other
    (Davenport 1973). The second angle keeps within a right angle of where the third axis is square
    on the first; at either end of that the two are parallel, and the third angle is 0.
    """
    first, second, _ = axes
    square, sign, skew = _skew(axes)
    basis = quat_from_matrix(np.stack([first, second, square], axis=-1))
    askew = quat_mul(q, quat_from_rotvec(second * skew))
    angles = euler_from_quat(quat_mul(quat_relative(basis, askew), basis), "xyz")
    return angles * np.array([1.0, 1.0, sign]) - np.array([0.0, skew, 0.0])


def hinge_path(
    q: Float[np.ndarray, "T 4"], axes: Float[np.ndarray, "3 3"], ranges: Float[np.ndarray, "3 2"]
) -> Float[np.ndarray, "T 3"]:
    """The angles [rad] of a motion, within ranges, and as continuous as these allow.

    A rotation has two solutions, and each angle repeats after a turn. Of all ways through them the
    one is taken that leaves the ranges least and jumps least (Viterbi 1967).
    """
    angles = hinge_angles(q, axes)
    middle = ranges.mean(axis=1)
    nearest = angles - _TURN * np.round((angles - middle) / _TURN)
    held = np.clip(nearest, ranges[:, 0], ranges[:, 1])
    if len(q) == 1 or np.abs(np.diff(held, axis=0)).max() < _JUMP:
        return held
    _, _, skew = _skew(axes)
    other = nearest * np.array([1.0, -1.0, 1.0]) + np.array([np.pi, np.pi - 2 * skew, np.pi])
    other -= _TURN * np.round((other - middle) / _TURN)
    ways = np.array([(a, 0.0, c) for a, c in product((-_TURN, 0.0, _TURN), repeat=2)])
    states = np.concatenate([nearest[:, None] + ways, other[:, None] + ways], axis=1)
    held = np.clip(states, ranges[:, 0], ranges[:, 1])
    outside = ((states - held) ** 2).sum(-1)
    return held[np.arange(len(q)), _cheapest(held, outside)]


def limit_speed(angles: Float[np.ndarray, "T *n"], step: float) -> Float[np.ndarray, "T *n"]:
    """The angles, where they change by more than `step` between frames passed through more slowly:
    as much too early as too late."""
    if len(angles) < 2 or np.abs(np.diff(angles, axis=0)).max() <= step:
        return angles
    return 0.5 * (_follow(angles, step) + _follow(angles[::-1], step)[::-1])


def _follow(angles: Float[np.ndarray, "T *n"], step: float) -> Float[np.ndarray, "T *n"]:
    out = angles.copy()
    for t in range(1, len(out)):
        out[t] = np.clip(angles[t], out[t - 1] - step, out[t - 1] + step)
    return out


def _cheapest(
    states: Float[np.ndarray, "T S 3"], costs: Float[np.ndarray, "T S"]
) -> Int[np.ndarray, "T"]:
    """The state of each frame on the way with the least costs and squared steps."""
    frames, count = costs.shape
    came_from = np.zeros((frames, count), dtype=int)
    total = costs[0]
    for t in range(1, frames):
        steps = ((states[t][:, None] - states[t - 1]) ** 2).sum(-1)
        reached = total + _STEP * steps
        came_from[t] = reached.argmin(1)
        total = costs[t] + reached[np.arange(count), came_from[t]]
    path = np.empty(frames, dtype=int)
    path[-1] = total.argmin()
    for t in range(frames - 1, 0, -1):
        path[t - 1] = came_from[t, path[t]]
    return path


def _skew(axes: Float[np.ndarray, "3 3"]) -> tuple[Float[np.ndarray, "3"], float, float]:
    """The axis square on the first two; whether the third points along or against it; and by what
    angle about the second it is off."""
    first, second, third = axes
    square = np.cross(first, second)
    sign = 1.0 if third @ square >= 0 else -1.0
    return square, sign, float(np.arctan2(sign * (third @ first), sign * (third @ square)))
