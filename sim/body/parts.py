"""Which joints of a rig get a MuJoCo body, and what its part, joint and hinges are called."""

from sim.body.joints import HINGES, JOINT_NAMES, Hinge
from spark.rig.rig import Rig

LINK = "link"  # the part of a joint without a role that carries one with a role
DETAIL = "detail"  # and of one that does not: fingers, face, hair


def kept_joints(rig: Rig) -> tuple[int, ...]:
    """The joints that get a body: the root joint and all below it, parents first."""
    return rig.skeleton.subtree(rig.root_joint)


def part_of(rig: Rig, joint: int) -> str:
    """The role without its side (`left_foot`: "foot"), or `LINK` or `DETAIL`."""
    role = rig.roles.roles[joint]
    if role is not None:
        return role.part
    carries = any(rig.roles.roles[k] for k in rig.skeleton.subtree(joint))
    return LINK if carries else DETAIL


def joint_class_of(rig: Rig, joint: int) -> str:
    """The default class of the joint that turns such a part: "knee" for a lower leg."""
    part = part_of(rig, joint)
    return JOINT_NAMES.get(part, part)


def side_of(rig: Rig, joint: int) -> str:
    """ "left", "right" or "", from the joint's role or that of the nearest joint above it."""
    for k in rig.skeleton.ancestors(joint):
        role = rig.roles.roles[k]
        if role is not None:
            return role.side
    return ""


def hinges_of(rig: Rig, joint: int) -> tuple[tuple[str, Hinge], ...]:
    """The hinges of a joint on a body of hinges, outermost first, and their names on it; none for
    the root joint and for joints without a role."""
    if joint == rig.root_joint:
        return ()
    hinges = HINGES.get(joint_class_of(rig, joint), ())
    name = rig.skeleton.names[joint]
    if len(hinges) == 1:
        return ((name, hinges[0]),)
    return tuple((f"{name}_{hinge.name}", hinge) for hinge in hinges)
