"""Where a joint turns: at the point nearest to all axes of its hinges.

Real hinges miss each other by centimetres, and are anchored anywhere along their axes.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from robots.tree import Tree

_COS_ALONG = np.cos(np.radians(45))  # of a hinge's axis to a limb that it turns about itself


def nearest_point(
    anchors: Float[np.ndarray, "N 3"], axes: Float[np.ndarray, "N 3"]
) -> tuple[Float[np.ndarray, "3"], float]:
    """The point with the least squared distance to some lines, and its largest distance [m].

    Where the lines leave it open (a single line), it is the one nearest to their anchors.
    """
    across = np.eye(3) - axes[:, :, None] * axes[:, None]
    middle = anchors.mean(0)
    right = (across @ (anchors - middle)[:, :, None])[..., 0].sum(0)
    point = middle + np.linalg.lstsq(across.sum(0), right, rcond=1e-3)[0]
    away = (across @ (point - anchors)[:, :, None])[..., 0]
    return point, float(np.linalg.norm(away, axis=-1).max())


def joint_centers(tree: Tree, groups: Sequence[tuple[int, ...]]) -> list[Float[np.ndarray, "3"]]:
    """The centre of each group. A single hinge leaves its place along the axis open: there it lies
    nearest to the middle of its neighbours. The last one of a limb that turns it about itself, as
    a wrist does, stays where the file has it: the middle would be at the limb's other end.
    """
    fixed = {
        g: tree.anchors[group[0]]
        if tree.balls[group[0]]
        else nearest_point(tree.anchors[list(group)], tree.axes[list(group)])[0]
        for g, group in enumerate(groups)
        if len(group) > 1 or tree.balls[group[0]]
    }
    of_joint = {j: g for g, group in enumerate(groups) for j in group}
    above = [of_joint.get(int(tree.parents[group[0]]), -1) for group in groups]
    below: dict[int, list[int]] = {}
    for g, up in enumerate(above):
        below.setdefault(up, []).append(g)
    centers = []
    for g, group in enumerate(groups):
        if g in fixed:
            centers.append(fixed[g])
            continue
        up = above[g]
        while up >= 0 and up not in fixed:
            up = above[up]
        known = [fixed[up]] if up >= 0 else _fixed_below(-1, below, fixed, but=g)
        known += (beyond := _fixed_below(g, below, fixed))
        anchor, axis = tree.anchors[group[0]], tree.axes[group[0]]
        middle = np.mean(known, axis=0) if known else anchor
        limb = anchor - middle
        if up >= 0 and not beyond and abs(axis @ limb) > _COS_ALONG * np.linalg.norm(limb):
            middle = anchor
        centers.append(anchor + axis * (axis @ (middle - anchor)))
    return centers


def _fixed_below(
    g: int,
    below: Mapping[int, Sequence[int]],
    fixed: dict[int, Float[np.ndarray, "3"]],
    but: int | None = None,
) -> list[Float[np.ndarray, "3"]]:
    """The middle of the nearest groups below g whose centres are known; nothing without any."""
    found = []
    waiting = [g]
    while waiting:
        for child in below.get(waiting.pop(), ()):
            if child == but:
                continue
            if child in fixed:
                found.append(fixed[child])
            else:
                waiting.append(child)
    return [np.mean(found, axis=0)] if found else []
