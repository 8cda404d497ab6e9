"""Rotations, for numpy arrays and torch tensors alike (more forms: `spark.euler`, `spark.sixd`).

Quaternions are wxyz, unit, Hamilton; matrices act on column vectors; angles are radians. `q_a_b`
and `R_a_b` map b-coordinates into a, so `quat_mul(q_a_b, q_b_c)` is `q_a_c`. All functions
broadcast over leading axes, keep the dtype and the device, and have finite values everywhere.
Gradients are finite too, but for the heading of a body upside down.

Sources: Shoemake 1985 (slerp); Shepperd 1978 (matrix to quaternion); Dobrowolski 2015 (swing and
twist).
"""

from typing import Any, Literal, get_args

from array_api_compat import array_namespace
from jaxtyping import Float

from spark.vectors import cross, dot, joined, norm, unit

Axis = Literal["x", "y", "z"]
AXES: tuple[Axis, ...] = get_args(Axis)

# Below this squared angle the Taylor series of sin(x)/x is exact in float64 to its last bits.
_SMALL_SQUARED = 1e-6


def quat_mul(q_a_b: Float[Any, "*#n 4"], q_b_c: Float[Any, "*#n 4"]) -> Float[Any, "*n 4"]:
    """Hamilton product: the rotation `q_b_c` followed by `q_a_b`."""
    w1, x1, y1, z1 = (q_a_b[..., i] for i in range(4))
    w2, x2, y2, z2 = (q_b_c[..., i] for i in range(4))
    return joined(
        [
            w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
            w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
            w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
            w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
        ],
        q_b_c,
    )


def quat_conj(q_a_b: Float[Any, "*n 4"]) -> Float[Any, "*n 4"]:
    """The inverse rotation `q_b_a` of a unit quaternion."""
    w, x, y, z = (q_a_b[..., i] for i in range(4))
    return joined([w, -x, -y, -z], q_a_b)


def quat_relative(q_a_b: Float[Any, "*#n 4"], q_a_c: Float[Any, "*#n 4"]) -> Float[Any, "*n 4"]:
    """`q_b_c`: the conjugate of `q_a_b` times `q_a_c`, in one go."""
    w1, x1, y1, z1 = (q_a_b[..., i] for i in range(4))
    w2, x2, y2, z2 = (q_a_c[..., i] for i in range(4))
    return joined(
        [
            w1 * w2 + x1 * x2 + y1 * y2 + z1 * z2,
            w1 * x2 - x1 * w2 - y1 * z2 + z1 * y2,
            w1 * y2 + x1 * z2 - y1 * w2 - z1 * x2,
            w1 * z2 - x1 * y2 + y1 * x2 - z1 * w2,
        ],
        q_a_c,
    )


def quat_rotate(q_a_b: Float[Any, "*#n 4"], v_b: Float[Any, "*#n 3"]) -> Float[Any, "*n 3"]:
    """The vector `v_b` in a-coordinates."""
    w, x, y, z = (q_a_b[..., i] for i in range(4))
    a, b, c = (v_b[..., i] for i in range(3))
    tx, ty, tz = 2 * (y * c - z * b), 2 * (z * a - x * c), 2 * (x * b - y * a)
    return joined(
        [
            a + w * tx + y * tz - z * ty,
            b + w * ty + z * tx - x * tz,
            c + w * tz + x * ty - y * tx,
        ],
        q_a_b,
    )


def quat_normalize(q: Float[Any, "*n 4"]) -> Float[Any, "*n 4"]:
    """The unit quaternion along `q`; the zero quaternion becomes the identity."""
    xp = array_namespace(q)
    squared = dot(q, q)
    zero = squared == 0
    identity = quat_identity(q)
    return xp.where(zero, identity, q / xp.sqrt(xp.where(zero, xp.ones_like(squared), squared)))


def quat_identity(like: Float[Any, "*n _"]) -> Float[Any, "*n 4"]:
    """Identity quaternions with the leading shape, dtype and device of `like`."""
    xp = array_namespace(like)
    zero = xp.zeros_like(like[..., 0])
    return joined([xp.ones_like(zero), zero, zero, zero], like)


def quat_continuous(q: Float[Any, "T *n 4"]) -> Float[Any, "T *n 4"]:
    """The same rotations, signed so that neighbours along the first axis are the nearer pair."""
    xp = array_namespace(q)
    dots = dot(q[1:], q[:-1])
    flips = xp.where(dots < 0, -xp.ones_like(dots), xp.ones_like(dots))
    return xp.concat([q[:1], q[1:] * xp.cumulative_prod(flips, axis=0)], axis=0)


def quat_angle(q_a_b: Float[Any, "*#n 4"], q_a_c: Float[Any, "*#n 4"]) -> Float[Any, "*n"]:
    """The angle in [0, pi] between two rotations, exact near 0 and near pi."""
    xp = array_namespace(q_a_b, q_a_c)
    relative = quat_relative(q_a_b, q_a_c)
    return 2 * xp.atan2(norm(relative[..., 1:])[..., 0], xp.abs(relative[..., 0]))


def quat_from_rotvec(rotvec: Float[Any, "*n 3"]) -> Float[Any, "*n 4"]:
    """Exponential map: a rotation by `|rotvec|` radians about `rotvec`."""
    xp = array_namespace(rotvec)
    squared = dot(rotvec, rotvec)
    small = squared < _SMALL_SQUARED
    safe = xp.where(small, xp.ones_like(squared), squared)
    angle = xp.sqrt(safe)
    half_sinc = xp.where(small, 0.5 - squared / 48, xp.sin(angle / 2) / angle)
    cos = xp.where(small, 1 - squared / 8 + squared**2 / 384, xp.cos(angle / 2))
    parts = half_sinc * rotvec
    return joined([cos[..., 0], *(parts[..., i] for i in range(3))], rotvec)


def rotvec_from_quat(q: Float[Any, "*n 4"]) -> Float[Any, "*n 3"]:
    """Logarithm map: the rotation vector of at most pi radians."""
    xp = array_namespace(q)
    q = xp.where(q[..., :1] < 0, -q, q)
    w, vector = q[..., :1], q[..., 1:]
    squared = dot(vector, vector)
    small = squared < _SMALL_SQUARED
    safe = xp.where(small, xp.ones_like(squared), squared)
    length = xp.sqrt(safe)
    # Series of 2 atan(s/w)/s in s, for unit quaternions with small vector part s.
    safe_w = xp.where(small, w, xp.ones_like(w))
    series = 2 / safe_w * (1 - squared / (3 * safe_w**2) + squared**2 / (5 * safe_w**4))
    return xp.where(small, series, 2 * xp.atan2(length, w) / length) * vector


def quat_slerp(
    q0: Float[Any, "*#n 4"], q1: Float[Any, "*#n 4"], fraction: Float[Any, "*#n"]
) -> Float[Any, "*n 4"]:
    """Spherical interpolation along the shorter arc: `q0` at fraction 0, `q1` at 1."""
    xp = array_namespace(q0, q1)
    inner = dot(q0, q1)
    # What is divided by must not be 0. That the cosine of a small angle tells its square only to
    # the last bit does no harm: the shares depend on nothing else, and hardly on that.
    most = (1 - xp.finfo(q1.dtype).eps) * xp.ones_like(inner)
    angle = xp.acos(xp.minimum(xp.abs(inner), most))
    part, sine = fraction[..., None], xp.sin(angle)
    second = xp.copysign(xp.sin(part * angle) / sine, inner)
    return xp.sin((1 - part) * angle) / sine * q0 + second * q1


def quat_between(u: Float[Any, "*#n 3"], v: Float[Any, "*#n 3"]) -> Float[Any, "*n 4"]:
    """The smallest rotation that takes the direction of `u` to that of `v`.

    Opposite directions turn by pi about an axis orthogonal to `u`, chosen by `u` alone. Vectors
    shorter than 1e-12 have no direction: the identity.
    """
    xp = array_namespace(u, v)
    u, v = xp.broadcast_arrays(u, v)
    u, v = unit(u), unit(v)
    # (1 + u.v, u x v) by way of the sum, which keeps its digits where the two nearly cancel.
    between = u + v
    squared = dot(between, between)[..., 0]
    opposite = squared < (16 * xp.finfo(u.dtype).eps) ** 2
    short = xp.minimum(dot(u, u), dot(v, v))[..., 0] < 0.25  # what `unit` left alone
    x, y, z = (u[..., i] for i in range(3))
    zero, flat = xp.zeros_like(x), xp.abs(x) > xp.abs(z)
    orthogonal = (xp.where(flat, -y, zero), xp.where(flat, x, -z), xp.where(flat, zero, y))
    axis = cross(u, between)
    turned = [xp.where(opposite, o, axis[..., i]) for i, o in enumerate(orthogonal)]
    w = xp.where(short, xp.ones_like(x), xp.where(opposite, zero, squared / 2))
    q = joined([w, *turned], u)
    return q / xp.sqrt(dot(q, q))


def quat_swing_twist(
    q: Float[Any, "*#n 4"], axis: Float[Any, "*#n 3"]
) -> tuple[Float[Any, "*n 4"], Float[Any, "*n 4"]]:
    """Split `q = swing * twist`: `twist` turns about the unit `axis`, `swing` about a normal of it.

    Where the twist is undefined (swing of pi) it is the identity.
    """
    xp = array_namespace(q, axis)
    along = dot(q[..., 1:], axis)
    w = q[..., :1] + xp.zeros_like(along)
    twist = quat_normalize(xp.concat([w, along * axis], axis=-1))
    return quat_mul(q, quat_conj(twist)), twist


def yaw_from_quat(q: Float[Any, "*n 4"]) -> Float[Any, "*n"]:
    """Heading in (-pi, pi]: the angle of the twist about world Z."""
    xp = array_namespace(q)
    w, z = q[..., 0], q[..., 3]
    sign = xp.where(w < 0, -xp.ones_like(w), xp.ones_like(w))
    return 2 * xp.atan2(z * sign, w * sign)


def quat_from_yaw(yaw: Float[Any, "*n"]) -> Float[Any, "*n 4"]:
    """A rotation by `yaw` about Z."""
    return quat_about("z", yaw)


def quat_about(axis: Axis, angle: Float[Any, "*n"]) -> Float[Any, "*n 4"]:
    """A rotation by `angle` about one coordinate axis."""
    xp = array_namespace(angle)
    parts = [xp.cos(angle / 2)] + [xp.zeros_like(angle)] * 3
    parts[1 + AXES.index(axis)] = xp.sin(angle / 2)
    return xp.stack(parts, axis=-1)


def matrix_from_quat(q: Float[Any, "*n 4"]) -> Float[Any, "*n 3 3"]:
    """The rotation matrix of a unit quaternion."""
    xp = array_namespace(q)
    w, x, y, z = (q[..., i] for i in range(4))
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return xp.stack([xp.stack(row, axis=-1) for row in rows], axis=-2)


def quat_from_matrix(R: Float[Any, "*n 3 3"]) -> Float[Any, "*n 4"]:
    """The quaternion of a rotation matrix, with w >= 0 (Shepperd's four branches, batched)."""
    xp = array_namespace(R)
    r = [[R[..., i, j] for j in range(3)] for i in range(3)]
    t = r[0][0] + r[1][1] + r[2][2]
    candidates = xp.stack(
        [
            xp.stack([1 + t, r[2][1] - r[1][2], r[0][2] - r[2][0], r[1][0] - r[0][1]], axis=-1),
            xp.stack(
                [r[2][1] - r[1][2], 1 + 2 * r[0][0] - t, r[0][1] + r[1][0], r[0][2] + r[2][0]],
                axis=-1,
            ),
            xp.stack(
                [r[0][2] - r[2][0], r[0][1] + r[1][0], 1 + 2 * r[1][1] - t, r[1][2] + r[2][1]],
                axis=-1,
            ),
            xp.stack(
                [r[1][0] - r[0][1], r[0][2] + r[2][0], r[1][2] + r[2][1], 1 + 2 * r[2][2] - t],
                axis=-1,
            ),
        ],
        axis=-2,
    )
    diagonal = xp.stack([t, r[0][0], r[1][1], r[2][2]], axis=-1)
    best = xp.argmax(diagonal, axis=-1)
    choice = best[..., None] == xp.arange(4, dtype=best.dtype)
    q = xp.sum(xp.where(choice[..., None], candidates, xp.zeros_like(candidates)), axis=-2)
    return quat_normalize(xp.where(q[..., :1] < 0, -q, q))
