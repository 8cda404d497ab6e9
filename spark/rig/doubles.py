"""Joints that turn as one with a role does: nulls before it, and chains of joints beside a limb's
own, on which the skin of many rigs hangs.

MikuMikuDance's models have 左足D beside 左足, rigs of control bones DEF-thigh.L beside ORG-thigh.L.
Inside the program that made them, constraints turn one as the other; a file has none of these.
"""

from collections.abc import Sequence

import numpy as np

from spark.rig.nulls import nulls_of
from spark.rig.roles import Role
from spark.skeleton import Skeleton

_APART = 1e-3  # of the skeleton's size: files round their numbers


def doubles_of(skeleton: Skeleton, roles: Sequence[Role | None]) -> dict[int, int]:
    """For each joint that doubles one with a role, that one.

    A double has no role and rests where its original does. It is its null, or hangs on what carries
    the original or on a double of it, and the chain below goes on beside the original's.
    """
    nulls = nulls_of(skeleton)
    found: dict[int, int] = {}
    for null in sorted(nulls, reverse=True):  # the last before a joint first
        carried = found.get(nulls[null], nulls[null])
        if roles[null] is None and roles[carried] is not None:
            found[null] = carried
    rest = skeleton.rest_positions
    near = _APART * float(np.ptp(rest, axis=0).max())
    held = [j for j, role in enumerate(roles) if role is not None]
    places = rest[held]
    beside = {
        j: [held[k] for k in np.flatnonzero(abs(places - rest[j]).max(axis=1) < near)]
        for j, role in enumerate(roles)
        if role is None and j not in found
    }
    if not any(beside.values()):
        return found
    above = {r: _next_above(skeleton, roles, r) for r in held}
    # The joint with a role that each joint turns with, and whether it does so through a double.
    carriers: list[tuple[int, bool]] = []
    for j, role in enumerate(roles):
        parent = int(skeleton.parents[j])
        carrier, doubled = carriers[parent] if parent >= 0 else (-1, False)
        carriers.append((carrier, doubled) if role is None else (j, False))
        for r in beside.get(j, ()):
            if above[r] != carrier or carrier < 0:
                continue
            below = skeleton.subtree(j)
            if r in below or r in skeleton.ancestors(j):
                continue
            after = {k for k in held if above[k] == r}
            if doubled or any(not after.isdisjoint(beside.get(k, ())) for k in below):
                found[j] = r
                carriers[j] = (r, True)
                break
    return found


def _next_above(skeleton: Skeleton, roles: Sequence[Role | None], joint: int) -> int:
    return next((j for j in skeleton.ancestors(joint)[1:] if roles[j] is not None), -1)
