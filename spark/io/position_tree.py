"""A tree for joints of which positions and names are known, and a motion that has no rotations."""

import re

import numpy as np
from jaxtyping import Float, Int

from spark.motion import Motion
from spark.skeleton import Skeleton

_ROOTS = ("hips", "pelvis", "root", "hip", "midhip", "mid_hip", "pelvis_joint")
_LEFT = re.compile(r"(?i:left)|(^|[_.: -])[lL]([_.: -]|$)|(^|:)[lL](?=[A-Z])")
_RIGHT = re.compile(r"(?i:right)|(^|[_.: -])[rR]([_.: -]|$)|(^|:)[rR](?=[A-Z])")


def parents_first(parents: list[int]) -> list[int]:
    """The joints in an order in which parents come first, without those in a circle."""
    order = [j for j, parent in enumerate(parents) if parent < 0]
    for j in order:
        order += [c for c, parent in enumerate(parents) if parent == j]
    return order


def rigid_tree(values: Float[np.ndarray, "T J 3"], names: tuple[str, ...]) -> Int[np.ndarray, "J"]:
    """Parents such that distances along bones change least (Prim's tree), nearer ones first.

    The trunk is all of one piece, and sides tell its tree: no joint of the middle hangs on one of a
    side, and none of a side on one of the other.
    """
    sample = values[np.unique(np.linspace(0, len(values) - 1, 300).astype(int))]
    distance = np.linalg.norm(sample[:, :, None] - sample[:, None], axis=-1)
    sides = np.array([_side(name) for name in names])
    cost = distance.std(axis=0) + 0.1 * distance.mean(axis=0)
    cost[(sides[:, None] != 0) & (sides[None] != sides[:, None])] += 10 * cost.max()
    root = next(
        (j for j, name in enumerate(names) if name.lower().rpartition(":")[2] in _ROOTS), None
    )
    if root is None:
        root = int(np.argmin(distance.mean(axis=(0, 1))))
    parents = np.full(len(names), -1)
    best, nearest = cost[root].copy(), np.full(len(names), root)
    left = set(range(len(names))) - {root}
    while left:
        j = min(left, key=lambda i: best[i])
        left.remove(j)
        parents[j] = nearest[j]
        closer = cost[j] < best
        best[closer], nearest[closer] = cost[j][closer], j
    return parents


def _side(name: str) -> int:
    """1 for a joint of the left, -1 of the right, 0 of the middle, as its name says."""
    for side, pattern in ((1, _LEFT), (-1, _RIGHT)):
        if pattern.search(name):
            return side
    return 0


def still(
    values: Float[np.ndarray, "T J 3"], names: tuple[str, ...], parents: Int[np.ndarray, "J"]
) -> Motion:
    """Positions as a motion without rotations."""
    local = values - values[:, np.maximum(parents, 0)]
    local[:, 0] = values[:, 0]
    rotations = np.zeros((*values.shape[:2], 4))
    rotations[..., 0] = 1.0
    offsets = np.median(local, axis=0)
    skeleton = Skeleton(names, parents, offsets, np.ones(len(names), dtype=bool))
    return Motion(skeleton, 1.0, values[:, 0], rotations, local)
