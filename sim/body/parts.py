"""Which joints of a rig move its body, and what each of them is called on it."""

from sim.body.joints import HINGES, JOINTS, Hinge
from spark.rig.rig import Rig

LINK = "link"
DETAIL = "detail"


def kept_joints(rig: Rig) -> tuple[int, ...]:
    """The joints that have a body: the carrier and all below it, parents first."""
    return rig.skeleton.subtree(rig.root_joint)


def kind_of(rig: Rig, joint: int) -> str:
    """The role without its side (`left_foot`: "foot"); of a joint without a role, "link" where it
    carries one that has a role, else "detail": fingers, face, hair."""
    role = rig.roles.roles[joint]
    if role is not None:
        return role.part
    carries = any(rig.roles.roles[k] for k in rig.skeleton.subtree(joint))
    return LINK if carries else DETAIL


def joint_kind_of(rig: Rig, joint: int) -> str:
    """What the joint that turns such a part is called: "knee" for a lower leg."""
    kind = kind_of(rig, joint)
    return JOINTS.get(kind, kind)


def side_of(rig: Rig, joint: int) -> str:
    """ "left", "right" or "", from the joint's role or that of the nearest joint above it."""
    for k in rig.skeleton.ancestors(joint):
        role = rig.roles.roles[k]
        if role is not None:
            return role.side
    return ""


def hinges_of(rig: Rig, joint: int) -> tuple[tuple[str, Hinge], ...]:
    """The hinges of a joint on a body of hinges, outermost first, and their names on it; none for
    the carrier and for joints without a role."""
    if joint == rig.root_joint:
        return ()
    hinges = HINGES.get(joint_kind_of(rig, joint), ())
    name = rig.skeleton.names[joint]
    if len(hinges) == 1:
        return ((name, hinges[0]),)
    return tuple((f"{name}_{hinge.name}", hinge) for hinge in hinges)
