"""A robot's rigid parts as the joints of a skeleton, and what they are called."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from robots.model.mjcf import Mjcf
from robots.model.segments import Segment
from robots.model.shapes import surface
from spark.rig.name_hints import read_names
from spark.rig.roles import Role, RoleMap
from spark.skeleton import Skeleton

Points = list[Float[np.ndarray, "_ 3"]]
_HANDS = (Role.LEFT_HAND, Role.RIGHT_HAND)


def telling_names(segments: Sequence[Segment]) -> tuple[str, ...]:
    """For each part the name that says most about its role: of its first joint, its own body, or
    that joint's. Of equals the joint's wins: `Left_Elbow_Yaw` may move a `left_hand_link`."""
    candidates = [
        [_without_kind(segment.names[min(k, len(segment.names) - 1)]) for segment in segments]
        for k in (1, 0, 2)
    ]
    hints = [read_names(names) for names in candidates]
    telling = []
    for i in range(len(segments)):
        # A part named for sure counts 1; a side, then a finger or the like, breaks ties.
        scores = [
            max(h[i].parts.values(), default=0.0) + 0.1 * bool(h[i].side) + 0.05 * bool(h[i].aside)
            for h in hints
        ]
        telling.append(candidates[int(np.argmax(scores))][i])
    return tuple(telling)


def _without_kind(name: str) -> str:
    """The name without its ending for the kind of element: `left_knee_joint` -> `left_knee`."""
    for word in ("_joint", "_link", "_body"):
        if name.lower().endswith(word):
            return name[: -len(word)]
    return name


def shaped_parts(mjcf: Mjcf, segments: Sequence[Segment]) -> tuple[list[Segment], Points, Points]:
    """The parts, points on the surface of each [m, rest pose's world], and the same with those of
    what is welded to it. That is no part of its own where it does not reach beyond what carries
    it, as heads and hands do, and cameras and guards don't."""
    points = [surface(mjcf, _welded_to(mjcf, segment.body, segments)) for segment in segments]
    inside = {
        i
        for i, segment in enumerate(segments)
        if _is_welded(segments, i)
        and _reach(points[i], segments[segment.parent])
        <= _reach(points[segment.parent], segments[segment.parent])
    }
    shapes = list(points)
    for i in sorted(inside):
        above = segments[i].parent
        shapes[above] = np.concatenate([shapes[above], points[i]])
    segments, kept = without(segments, inside)
    return segments, [points[k] for k in kept], [shapes[k] for k in kept]


def without(segments: Sequence[Segment], left_out: set[int]) -> tuple[list[Segment], list[int]]:
    """The parts but for some that carry nothing, and the old number of each."""
    kept = [k for k in range(len(segments)) if k not in left_out]
    new = {-1: -1} | {k: i for i, k in enumerate(kept)}
    return [replace(segments[k], parent=new[segments[k].parent]) for k in kept], kept


def _is_welded(segments: Sequence[Segment], i: int) -> bool:
    """Whether a part is fixed to the one that carries it, and carries nothing itself."""
    own, above = segments[i], segments[i].parent
    return (
        above >= 0
        and not own.joints
        and own.link == segments[above].link
        and all(segment.parent != i for segment in segments)
    )


def _reach(points: Float[np.ndarray, "P 3"], carrier: Segment) -> float:
    """How far [m] points are from where their carrier turns."""
    return float(np.linalg.norm(points - carrier.center, axis=1).max(initial=0.0))


def _welded_to(mjcf: Mjcf, body: int, segments: Sequence[Segment]) -> list[int]:
    """The body and those that are welded to it, but for those that are parts of their own."""
    own = {segment.body for segment in segments} - {body}
    model = mjcf.model
    inside = {body}
    for other in mjcf.bodies():
        above = int(model.body_parentid[other])
        if above in inside and other not in own and not model.body_jntnum[other]:
            inside.add(other)
    return sorted(inside)


def rigid_points(
    segments: Sequence[Segment], roles: RoleMap, points: Sequence[Float[np.ndarray, "_ 3"]]
) -> list[Float[np.ndarray, "_ 3"]]:
    """`points`, with those of welded parts that have no role at the parts that carry them: a sole
    that is welded to an ankle is the foot's."""
    joined = list(points)
    for i in reversed(range(len(segments))):
        above = segments[i].parent
        if above >= 0 and roles.roles[i] is None and not segments[i].joints:
            joined[above] = np.concatenate([joined[above], joined[i]])
            joined[i] = joined[i][:0]
    return joined


def fixtures_of(segments: Sequence[Segment], roles: RoleMap) -> set[int]:
    """The welded parts without a role, such as tools: they don't show where a limb points, but for
    what hands have, which may be fingers."""
    return {
        i
        for i, segment in enumerate(segments)
        if _is_welded(segments, i)
        and roles.roles[i] is None
        and roles.roles[segment.parent] not in _HANDS
    }


def skeleton_of(
    segments: Sequence[Segment],
    points: Sequence[Float[np.ndarray, "_ 3"]],
    names: tuple[str, ...],
) -> Skeleton:
    """The parts as joints of a skeleton; an End Site at the far end of each childless part."""
    parents = np.array([segment.parent for segment in segments])
    centers = np.array([segment.center for segment in segments])
    offsets = centers - np.where(parents[:, None] < 0, 0.0, centers[parents])
    leaves = [i for i in range(len(segments)) if i not in parents and len(points[i])]
    ends = [_far_end(points[i] - centers[i]) for i in leaves]
    return Skeleton(
        names=names,
        parents=parents,
        offsets=offsets,
        translating=np.arange(len(segments)) == 0,
        end_parents=np.array(leaves, dtype=np.int64),
        end_offsets=np.array(ends).reshape(-1, 3),
    )


def _far_end(points: Float[np.ndarray, "P 3"]) -> Float[np.ndarray, "3"]:
    """The end [m, from the joint] of a part, on the line from its joint through its middle."""
    middle = (points.max(0) + points.min(0)) / 2
    length = float(np.linalg.norm(middle))
    if length < 1e-6:
        return points[int(np.argmax(np.linalg.norm(points, axis=1)))]
    along = middle / length
    return along * float((points @ along).max())
