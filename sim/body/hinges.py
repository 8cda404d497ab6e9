"""Rotations as the angles of hinges in a row."""

import numpy as np
from jaxtyping import Float

from spark.euler import euler_from_quat
from spark.rotation import (
    quat_from_matrix,
    quat_from_rotvec,
    quat_mul,
    quat_relative,
    quat_swing_twist,
    rotvec_from_quat,
)

_TURN = 2 * np.pi


def angles_within(
    q: Float[np.ndarray, "4"], axes: Float[np.ndarray, "K 3"], ranges: Float[np.ndarray, "K 2"]
) -> Float[np.ndarray, "K"]:
    """The angles [rad], within their ranges, of one hinge or of three that turn as `q` does.

    One hinge takes the rotation's twist about its axis. An angle beyond its range stops there.
    """
    if len(axes) == 1:
        angles = np.array([rotvec_from_quat(quat_swing_twist(q, axes[0])[1]) @ axes[0]])
    else:
        angles = davenport_angles(q, axes)
    angles = angles - _TURN * np.round((angles - ranges.mean(axis=1)) / _TURN)
    return np.clip(angles, ranges[:, 0], ranges[:, 1])


def davenport_angles(
    q: Float[np.ndarray, "*n 4"], axes: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "*n 3"]:
    """The angles [rad] with which `R(axes[0]) R(axes[1]) R(axes[2])` is the rotation.

    The second unit axis stands square on the other two, which may stand askew to each other
    (Davenport 1973). The second angle keeps within a right angle of where the third axis is square
    on the first; at either end of that the two are parallel, and the third angle is 0.
    """
    first, second, third = axes
    square = np.cross(first, second)
    sign = 1.0 if third @ square >= 0 else -1.0
    skew = float(np.arctan2(sign * (third @ first), sign * (third @ square)))
    basis = quat_from_matrix(np.stack([first, second, square], axis=-1))
    askew = quat_mul(q, quat_from_rotvec(second * skew))
    angles = euler_from_quat(quat_mul(quat_relative(basis, askew), basis), "xyz")
    return angles * np.array([1.0, 1.0, sign]) - np.array([0.0, skew, 0.0])
