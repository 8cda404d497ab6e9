"""Euler angles, as BVH means them, for numpy arrays and torch tensors alike.

Angles are radians. Gradients are finite but for those at the singularity.
"""

from typing import Any

from array_api_compat import array_namespace
from jaxtyping import Float

from spark.rotation import AXES, Axis, quat_about, quat_mul


def quat_from_euler(angles: Float[Any, "*n 3"], order: str) -> Float[Any, "*n 4"]:
    """Intrinsic Euler angles, as BVH means them: `order` "zxy" is `Rz(a0) Rx(a1) Ry(a2)`."""
    first, second, third = (
        quat_about(axis, angles[..., i]) for i, axis in enumerate(_axes_of(order))
    )
    return quat_mul(quat_mul(first, second), third)


def euler_from_quat(q: Float[Any, "*n 4"], order: str) -> Float[Any, "*n 3"]:
    """Intrinsic Euler angles of three different axes; the middle angle lies in [-pi/2, pi/2].

    At the singularity (middle angle of pi/2) the third angle is 0. Bernardes and Viollet 2022.
    """
    xp = array_namespace(q)
    k, j, i = (AXES.index(axis) for axis in _axes_of(order))  # intrinsic = extrinsic reversed
    sign = float((i - j) * (j - k) * (k - i) // 2)
    w, qi, qj, qk = q[..., 0], q[..., 1 + i], q[..., 1 + j], q[..., 1 + k] * sign
    a, b, c, d = w - qj, qi + qk, qj + w, qk - qi
    middle = 2 * xp.atan2(xp.sqrt(c * c + d * d), xp.sqrt(a * a + b * b)) - xp.pi / 2
    half_sum, half_difference = xp.atan2(b, a), xp.atan2(d, c)
    low, high = (c * c + d * d) < 1e-14, (a * a + b * b) < 1e-14
    first = xp.where(
        low, 2 * half_sum, xp.where(high, 2 * half_difference, half_sum + half_difference)
    )
    third = xp.where(low | high, xp.zeros_like(first), half_sum - half_difference)
    angles = xp.stack([sign * first, middle, third], axis=-1)
    return xp.remainder(angles + xp.pi, 2 * xp.pi) - xp.pi


def _axes_of(order: str) -> tuple[Axis, ...]:
    axes: tuple[Axis, ...] = tuple(a for c in order.lower() for a in AXES if a == c)
    if len(order) != 3 or len(set(axes)) != 3:
        raise ValueError(f"Euler order {order!r}: expected a permutation of 'xyz'")
    return axes
