"""Two poses in which the nodes of a file may rest: as their own transforms have it, or as the skin
was bound.

Many exporters write the nodes as they stand at some frame of a motion. What the skin was bound in
is the pose of the artist who hung it on the bones, a T or an A. Of the two poses the straighter one
is the rest pose.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from spark.io.nodes import line_to

_SHORT = 0.03  # of the body's size: shorter bones point anywhere
_STRAIGHTER = 0.5  # [rad] summed over all joints: two poses that bend alike are no reason to change
_SAME_LENGTH = 0.05  # of the longest bone: those that differ by more are of another body

NOTE = "its nodes rest in a pose: the one that its skin was bound in is taken instead"

Map = tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]
"""A node's place and linear map in the world."""


def matrix_of(placed: Map) -> Float[np.ndarray, "4 4"]:
    """A node's place and linear map as one matrix."""
    matrix = np.eye(4)
    matrix[:3, 3], matrix[:3, :3] = placed
    return matrix


def bound_pose(
    own: Mapping[int, Map],
    placed: Mapping[int, Float[np.ndarray, "4 4"]],
    joints: Sequence[int],
    parents: Sequence[int],
) -> dict[int, Map] | None:
    """All nodes as the skin was bound, from how their own transforms have them and where some were
    `placed` then: others are carried along. None where that pose is no straighter, or is that of
    another body."""
    if not placed:
        return None
    bound: dict[int, Map] = {}
    for node in sorted(own, key=lambda i: len(line_to(i, parents))):
        if node in placed:
            bound[node] = placed[node][:3, 3], placed[node][:3, :3]
        elif (above := parents[node]) < 0 or not np.linalg.det(own[above][1]):
            bound[node] = own[node]  # below what a scale of zero hides, too
        else:
            back = np.linalg.inv(own[above][1])
            at, axes = back @ (own[node][0] - own[above][0]), back @ own[node][1]
            bound[node] = bound[above][0] + bound[above][1] @ at, bound[above][1] @ axes
    before, after = (_bones(maps, joints, parents) for maps in (own, bound))
    if not before:
        return None
    lengths, since = (np.linalg.norm(list(of.values()), axis=1) for of in (before, after))
    if not (abs(since - lengths) <= _SAME_LENGTH * lengths.max()).all():
        return None
    straighter = _bend(before, parents) - _bend(after, parents) > _STRAIGHTER
    return bound if straighter else None


def _bones(
    maps: Mapping[int, Map], joints: Sequence[int], parents: Sequence[int]
) -> dict[int, Float[np.ndarray, "3"]]:
    """The bone from its parent to each joint whose parent is a joint."""
    inside = set(joints)
    return {j: maps[j][0] - maps[parents[j]][0] for j in joints if parents[j] in inside}


def _bend(bones: Mapping[int, Float[np.ndarray, "3"]], parents: Sequence[int]) -> float:
    """By how much chains of bones bend at all joints that carry one bone [rad]."""
    least = _SHORT * float(np.linalg.norm(list(bones.values()), axis=1).max())
    long = {j: bone for j, bone in bones.items() if np.linalg.norm(bone) > least}
    carried = [parents[j] for j in long]
    total = 0.0
    for j, bone in long.items():
        if (above := parents[j]) in long and carried.count(above) == 1:
            cosine = bone @ long[above] / (np.linalg.norm(bone) * np.linalg.norm(long[above]))
            total += float(np.arccos(np.clip(cosine, -1.0, 1.0)))
    return total
