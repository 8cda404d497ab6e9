"""Rotations as six numbers without a jump, as the network has them: two columns of the matrix.

Zhou et al. 2019, arXiv 1812.07035. For numpy arrays and torch tensors alike.
"""

from typing import Any

from array_api_compat import array_namespace
from jaxtyping import Float

from spark.rotation import quat_from_matrix
from spark.vectors import cross, dot, joined, unit


def matrix_from_sixd(sixd: Float[Any, "*n 6"]) -> Float[Any, "*n 3 3"]:
    """Gram-Schmidt on the two columns. Zero or parallel columns have no rotation: the gradient is
    finite there, the value is not a rotation."""
    xp = array_namespace(sixd)
    x = unit(sixd[..., :3])
    second = sixd[..., 3:]
    y = unit(second - dot(x, second) * x)
    return xp.stack([x, y, cross(x, y)], axis=-1)


def sixd_from_quat(q: Float[Any, "*n 4"]) -> Float[Any, "*n 6"]:
    """The first two columns of the matrix of a unit quaternion, one after the other."""
    w, x, y, z = (q[..., i] for i in range(4))
    columns = [
        *(1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        *(2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
    ]
    return joined(columns, q)


def quat_from_sixd(sixd: Float[Any, "*n 6"]) -> Float[Any, "*n 4"]:
    """The quaternion of a 6D rotation."""
    return quat_from_matrix(matrix_from_sixd(sixd))
