"""Euler angles over time: unwrapped, without needless turns at the singularity."""

import numpy as np
from jaxtyping import Float

from spark.euler import euler_from_quat
from spark.rotation import AXES, quat_about, quat_mul

# [rad] A middle angle this near to 90 degrees leaves only a sum of the other two defined.
_SINGULAR = 1e-6


def quat_from_angles(angles: Float[np.ndarray, "*n k"], order: str) -> Float[np.ndarray, "*n 4"]:
    """Intrinsic rotations [rad] about one or more axes: "zx" is `Rz(a0) Rx(a1)`."""
    first, *others = (
        quat_about(axis, angles[..., order.index(axis)])
        for letter in order
        for axis in AXES
        if axis == letter
    )
    for q in others:
        first = quat_mul(first, q)
    return first


def euler_over_time(q: Float[np.ndarray, "T *n 4"], order: str) -> Float[np.ndarray, "T *n k"]:
    """Intrinsic Euler angles [rad] of `order` that change as little as they can between frames.

    `order` names one to three different axes. With fewer than three the angles are exact for
    rotations that these axes can make, and leave out the rest of others. Three angles have a
    second solution, (a + pi, pi - b, c + pi): the first frame takes the one with b in
    [-pi/2, pi/2], the others the one that is nearer to the frame before.
    """
    return angles_over_time(angles_of(q, order), order)


def angles_of(q: Float[np.ndarray, "*n 4"], order: str) -> Float[np.ndarray, "*n k"]:
    """Euler angles [rad] of each rotation by itself, as `euler_over_time` takes them for a first
    frame."""
    if len(order) == 1:
        along = q[..., 1 + "xyz".index(order)]
        return 2 * np.arctan2(along, q[..., 0])[..., None]
    all_axes = order + "".join(axis for axis in AXES if axis not in order)
    angles = euler_from_quat(q, all_axes)
    if len(order) == 2:
        # The solution without a third angle is the one that two axes can express.
        other = _other(angles)
        exact = np.abs(_wrapped(other[..., 2])) < np.abs(angles[..., 2])
        return np.where(exact[..., None], other, angles)[..., :2]
    return angles


def angles_over_time(
    angles: Float[np.ndarray, "T *n k"], order: str
) -> Float[np.ndarray, "T *n k"]:
    """The angles of `angles_of` in successive frames, chosen as `euler_over_time` says."""
    if len(order) < 3:
        return np.unwrap(angles, axis=0)
    angles = angles.copy()
    _hold_third(angles, order)
    other = _other(angles)
    # Changing over saves the same whichever solution the frame before took, so that whether a frame
    # takes the other one is a parity of the changes up to it.
    stay = np.abs(_wrapped(angles[1:] - angles[:-1])).sum(axis=-1)
    change = np.abs(_wrapped(other[1:] - angles[:-1])).sum(axis=-1)
    changed = np.zeros(angles.shape[:-1], dtype=bool)
    changed[1:] = np.cumsum(change < stay, axis=0) % 2 == 1
    return np.unwrap(np.where(changed[..., None], other, angles), axis=0)


def _other(angles: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 3"]:
    return np.pi + np.array([1.0, -1.0, 1.0]) * angles


def _wrapped(angle: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    return np.remainder(angle + np.pi, 2 * np.pi) - np.pi


def _hold_third(angles: Float[np.ndarray, "T *n 3"], order: str) -> None:
    """In singular frames keep the third angle of the last regular frame; the first takes the rest.

    With b at +-pi/2 the rotation knows a + c or a - c alone.
    """
    singular = np.abs(np.abs(angles[..., 1]) - np.pi / 2) < _SINGULAR
    if not singular.any():
        return
    frames = np.arange(len(angles)).reshape(-1, *[1] * (angles.ndim - 2))
    last = np.maximum.accumulate(np.where(singular, -1, frames), axis=0)
    first = np.where(singular, len(angles), frames).min(axis=0)  # before it, look ahead
    source = np.where(last < 0, np.minimum(first, len(angles) - 1), last)
    held = np.take_along_axis(angles[..., 2], source, axis=0)
    even = order in ("xyz", "yzx", "zxy")
    sign = np.sign(angles[..., 1]) * (1 if even else -1)
    change = np.where(singular, held - angles[..., 2], 0.0)
    angles[..., 2] += change
    angles[..., 0] -= sign * change
