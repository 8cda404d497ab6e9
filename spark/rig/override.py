"""Roles that the user gives: what makes sense on a skeleton and what does not."""

from collections.abc import Mapping, Sequence
from itertools import pairwise

from spark.errors import SkeletonError
from spark.rig.roles import LIMBS, Role, RoleMap
from spark.skeleton import Skeleton

Override = Mapping[Role, Sequence[int]]
"""Roles given by the user: their joints from the pelvis outwards; none where nobody holds one."""

SEVERAL = (Role.SPINE, Role.NECK)
"""The roles that several joints may hold."""


def check_override(skeleton: Skeleton, override: Override) -> None:
    """Raise SkeletonError where a joint is given twice, does not exist, or is one too many."""
    given: dict[int, Role] = {}
    for role, joints in override.items():
        if len(joints) > 1 and role not in SEVERAL:
            names = ", ".join(repr(skeleton.names[j]) for j in joints)
            raise SkeletonError(f"{role} is given {len(joints)} joints ({names}); expected one")
        for j in joints:
            if not 0 <= j < len(skeleton):
                raise SkeletonError(
                    f"{role} is given joint {j}; expected 0 to {len(skeleton) - 1}, the joints of "
                    "this skeleton"
                )
            if j in given:
                raise SkeletonError(
                    f"joint {skeleton.names[j]!r} is given to {given[j]} and to {role}; a joint "
                    "holds one role"
                )
            given[j] = role


def check_chains(skeleton: Skeleton, roles: RoleMap) -> None:
    """Raise SkeletonError where a limb's joints do not follow each other down the skeleton."""
    for limb in LIMBS.values():
        held = [(role, j) for role in limb for j in roles.joints(role)]
        for (upper_role, upper), (lower_role, lower) in pairwise(held):
            if upper not in skeleton.ancestors(lower):
                raise SkeletonError(
                    f"{lower_role} {skeleton.names[lower]!r} ({roles.reasons[lower]}) is not below "
                    f"{upper_role} {skeleton.names[upper]!r} ({roles.reasons[upper]}); give both "
                    "in the map"
                )
