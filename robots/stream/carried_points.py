"""Places and directions that the joints of a skeleton carry, all in one product.

All of them are sums of what joints carry: so many numbers of a row, times the joints' places and
axes.
"""

from collections.abc import Iterable

import numpy as np
from jaxtyping import Float

ORIGIN = np.zeros(3)


def row(
    joints: int,
    places: Iterable[tuple[float, int]] = (),
    arms: Iterable[tuple[int, Float[np.ndarray, "3"]]] = (),
) -> Float[np.ndarray, "C"]:
    """The sum of joints' `places`, each so many times, and of `arms` [m] that turn with them."""
    out = np.zeros(4 * joints)
    for share, joint in places:
        out[joint] += share
    for joint, arm in arms:
        out[joints + 3 * joint : joints + 3 * joint + 3] += arm
    return out


def place(joints: int, joint: int, arm: Float[np.ndarray, "3"] = ORIGIN) -> Float[np.ndarray, "C"]:
    """Of a point that is `arm` [m] from a joint, and turns with it."""
    return row(joints, [(1.0, joint)], [(joint, arm)])


def carriers(
    rotations: Float[np.ndarray, "N 3 3"], places: Float[np.ndarray, "N 3"]
) -> Float[np.ndarray, "C 3"]:
    """What rows are multiplied by: the joints' places [m], and their axes."""
    return np.concatenate([places, rotations.transpose(0, 2, 1).reshape(-1, 3)])
