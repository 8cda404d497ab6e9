"""The paper's six body parts (section 4.1): which of them each joint belongs to."""

from spark.rig.roles import LEGS, LIMB_OF, Group, Role, RoleMap
from spark.skeleton import Skeleton

GROUP_OF_ROLE: dict[Role, Group] = {
    **LIMB_OF,
    Role.PELVIS: Group.TORSO,
    Role.SPINE: Group.TORSO,
    Role.NECK: Group.HEAD,
    Role.HEAD: Group.HEAD,
}
_ON_TOP = frozenset({Group.LEFT_ARM, Group.RIGHT_ARM, Group.HEAD})


def groups_of(skeleton: Skeleton, roles: RoleMap) -> tuple[frozenset[Group], ...]:
    """The groups of each joint.

    The hip joint is shared by torso and legs, the topmost spine joint by torso, arms and head; the
    pelvis stands in for a spine that isn't there. A joint without a role is in its parent's group,
    on the way between the joint that a limb hangs on and its first role in the limb's; above all
    roles, in the torso.
    """
    groups: list[frozenset[Group]] = []
    top = roles.joints(Role.SPINE)[-1:] or roles.joints(Role.PELVIS)
    for j, role in enumerate(roles.roles):
        if role is not None:
            own = frozenset({GROUP_OF_ROLE[role]})
            if role is Role.PELVIS:
                own |= {*LEGS}
            if j in top:
                own |= _ON_TOP
        else:
            own = _inherited(skeleton, roles, j, groups)
        groups.append(own)
    return tuple(groups)


def _inherited(
    skeleton: Skeleton, roles: RoleMap, joint: int, groups: list[frozenset[Group]]
) -> frozenset[Group]:
    parent = int(skeleton.parents[joint])
    if parent < 0 or len(groups[parent]) == 1:
        return groups[parent] if parent >= 0 else frozenset({Group.TORSO})
    # Below a shared joint: the part that the joint leads to, or the torso.
    below = {GROUP_OF_ROLE[r] for j in skeleton.subtree(joint) if (r := roles.roles[j]) is not None}
    return frozenset(below) if len(below) == 1 else frozenset({Group.TORSO})
