"""Which hinge bends a knee or an elbow, and which way."""

import numpy as np
from jaxtyping import Float, Int

from robots.tree import Tree
from spark.rig.bones import RigPose
from spark.rig.roles import Role
from spark.skeleton import Skeleton

BEND_AXES = {
    Role.LEFT_LOWER_LEG: np.array([0.0, 1, 0]),
    Role.RIGHT_LOWER_LEG: np.array([0.0, 1, 0]),
    Role.LEFT_FOREARM: np.array([0.0, 0, -1]),
    Role.RIGHT_FOREARM: np.array([0.0, 0, 1]),
}
"""The world axis about which a knee or elbow bends, by growing angles, in the T-pose."""
_SAME_RANGE = 0.2  # [rad] ranges to both sides of straight that differ by less say nothing
_BENT = 0.05  # [rad] of a joint in the rest pose that is bent, not merely drawn askew
_ASKEW = 0.3  # of a turn's motion, along an axis: less of it says nothing


def bend_hinges_of(
    tree: Tree, rest: RigPose, links: Int[np.ndarray, "J"], forward: Float[np.ndarray, "3"]
) -> dict[int, tuple[int, Float[np.ndarray, "3"]]]:
    """For each knee and elbow with hinges: the hinge that bends it, and the unit axis, in the rest
    pose, about which growing angles bend it. `forward` is where the rest pose looks."""
    out = {}
    for role in BEND_AXES:
        for j in rest.roles.joints(role):
            link = int(links[j])
            moves = link >= 0 and link != links[int(rest.skeleton.parents[j])]
            if moves and not tree.balls[link]:
                first = _first_own_hinge(tree, rest.skeleton, links, j)
                bending = forward if role.part == "forearm" else -forward
                out[j] = first, tree.axes[first] * _bend_sign(tree, rest, j, first, bending)
    return out


def _first_own_hinge(tree: Tree, skeleton: Skeleton, links: Int[np.ndarray, "J"], j: int) -> int:
    """The first of a joint's own hinges: the one that bends a knee or an elbow."""
    above = int(links[int(skeleton.parents[j])])
    own = int(links[j])
    while int(tree.parents[own]) != above and int(tree.parents[own]) >= 0:
        own = int(tree.parents[own])
    return own


def _bend_sign(
    tree: Tree, rest: RigPose, j: int, hinge: int, bending: Float[np.ndarray, "3"]
) -> float:
    """+1 where a growing angle bends the joint, -1 where a falling one does: joints bend to the
    side to which they have the larger range, measured from straight. Of two that are as large, the
    way it is bent already, or else the way that moves the bone's end along `bending`."""
    upper, lower = rest.bone(int(rest.skeleton.parents[j])), rest.bone(j)
    if upper is None or lower is None:
        return 1.0
    axis = tree.axes[hinge]
    across = lower @ upper - (lower @ axis) * (upper @ axis)
    straight = float(np.arctan2(np.cross(lower, upper) @ axis, across))
    above, below = tree.upper[hinge] - straight, straight - tree.lower[hinge]
    if not np.isclose(above, below, atol=_SAME_RANGE):
        return 1.0 if above > below else -1.0
    if abs(straight) > _BENT:
        return -1.0 if straight > 0 else 1.0
    return -1.0 if np.cross(axis, lower) @ bending < -_ASKEW * np.linalg.norm(lower) else 1.0
