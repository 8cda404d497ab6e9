"""What is welded to a robot's parts: a head or a hand of its own, more of the same part's shape, or
something that it wears or holds."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from robots.model.segments import Segment
from spark.rig.roles import HANDS, Role, RoleMap

Points = list[Float[np.ndarray, "_ 3"]]


def within(segments: Sequence[Segment], points: Points) -> set[int]:
    """The welded parts that reach no farther than what carries them, as cameras and guards: heads
    and hands do."""
    return {
        i
        for i, segment in enumerate(segments)
        if _is_welded(segments, i)
        and _reach(points[i], segments[segment.parent])
        <= _reach(points[segment.parent], segments[segment.parent])
    }


def joined(
    segments: Sequence[Segment], roles: RoleMap, points: Points, shapes: Points
) -> tuple[Points, Points]:
    """`points`, by which parts end, and `shapes`, with those of welded parts that have no role at
    the parts that carry them: a sole that is welded to an ankle is the foot's. They show where a
    part ends only where it has no shape of its own."""
    ends, together = list(points), list(shapes)
    for i in reversed(range(len(segments))):
        above = segments[i].parent
        if above >= 0 and roles.roles[i] is None and not segments[i].joints:
            together[above] = np.concatenate([together[above], together[i]])
            together[i] = together[i][:0]
            if not len(shapes[above]) and len(together[above]):
                ends[above] = together[above]
    return ends, together


def fixtures(segments: Sequence[Segment], roles: RoleMap) -> set[int]:
    """The welded parts without a role, such as tools, or that are the only hand of two arms: they
    don't show where a limb points, but for what hands have, which may be fingers."""
    return {
        i
        for i, segment in enumerate(segments)
        if _is_welded(segments, i)
        and (roles.roles[i] is None or _is_only_hand(roles, roles.roles[i]))
        and roles.roles[segment.parent] not in HANDS
    }


def _is_only_hand(roles: RoleMap, role: Role | None) -> bool:
    return role in HANDS and roles.joint(role.mirrored) is None


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
