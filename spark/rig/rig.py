"""A rig: a skeleton and all that was understood of it."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from spark.errors import SkeletonError, name_list
from spark.kinematics import world_positions
from spark.motion import Motion
from spark.rig.doubles import doubles_of
from spark.rig.feet import (
    FEET,
    HIP_HEIGHT,
    Sole,
    below_ankles,
    hip_height,
    human_soles,
)
from spark.rig.fingers import FingerBone, finger_bones, palms_of
from spark.rig.groups import groups_of
from spark.rig.other_bodies import other_bodies
from spark.rig.override import Override
from spark.rig.role_assignment import assign_roles
from spark.rig.roles import UPPER_LEGS, Group, Role, RoleMap
from spark.rig.tpose import find_tpose, root_joint_of
from spark.rig.twist_bones import TwistBone, twist_bones
from spark.skeleton import Skeleton
from spark.summary import counted

# Frames that are looked at for the T-pose: three minutes at 120 fps, or as much of a longer motion.
_FRAMES = 20_000
_LOWEST_HIPS = 1e-3  # [m] lower ones are those of no body, or of a unit that is wrong

# Roles that several joints hold, and those between which they lie.
_CHAINS: dict[Role, tuple[Role, Role | None]] = {
    Role.SPINE: (Role.PELVIS, None),
    Role.NECK: (Role.SPINE, Role.HEAD),
}


class Chain(NamedTuple):
    """The joints of a role that several hold, from the last joint before them to the first one
    after them, and where each lies: its normalised arc length in the T-pose, 0 to 1."""

    joints: list[int]
    positions: list[float]


@dataclass(frozen=True, eq=False)
class Rig:
    """A skeleton with its roles, groups and T-pose: what motions are transferred between.

    `tpose` holds each joint's `q_world_joint` in the T-pose: pelvis upright facing +X, legs down,
    arms out along +-Y, palms down. `groups[j]` are the body parts of joint j; the hip joint and the
    topmost spine joint belong to several. `root_joint` is the joint that takes the body's motion
    through the world: the lowest joint that the file can move and that carries all of the body.
    `hip_height` [m] is the height of the hips' middle above the sole in the T-pose. `shaped_soles`
    are those that the shapes of a model's feet show, left before right.
    """

    skeleton: Skeleton
    roles: RoleMap
    groups: tuple[frozenset[Group], ...]
    tpose: Float[np.ndarray, "J 4"]
    root_joint: int
    hip_height: float
    notes: tuple[str, ...] = ()
    shaped_soles: tuple[Sole, ...] = ()

    def __repr__(self) -> str:
        held = len(self.roles.held)
        joints = counted(len(self.skeleton), "joint")
        return f"Rig({joints}, {held} with a role, hips {self.hip_height:.3g} m high)"

    @cached_property
    def pelvis(self) -> int:
        """The joint that carries the legs."""
        return self.roles.require(Role.PELVIS)

    @cached_property
    def chest(self) -> int:
        """The topmost joint of the trunk."""
        return (self.pelvis, *self.roles.joints(Role.SPINE))[-1]

    @cached_property
    def hips(self) -> list[int]:
        """The upper-leg joints; their middle is the point that carries the body's path."""
        return [j for role in UPPER_LEGS for j in self.roles.joints(role)[:1]]

    @property
    def standing_height(self) -> float:
        """The height [m] of a human with this rig's hip height."""
        return self.hip_height / HIP_HEIGHT

    @cached_property
    def soles(self) -> tuple[Sole, ...]:
        """The soles of its feet, left before right; a side without a foot has none."""
        return self.shaped_soles or human_soles(
            self.skeleton, self.roles, self.tpose, self.hip_height
        )

    @cached_property
    def tpose_positions(self) -> Float[np.ndarray, "J 3"]:
        """The joints [m] in the T-pose, the root at the origin."""
        return world_positions(self.skeleton, self.tpose, np.zeros(3))

    @cached_property
    def chains(self) -> dict[Role, Chain]:
        """The spine, from the pelvis on, and the neck, from the topmost spine joint to the head."""
        return {role: self._chain(role, *ends) for role, ends in _CHAINS.items()}

    def _chain(self, role: Role, start: Role, end: Role | None) -> Chain:
        begin = self.roles.joints(start)[-1:] or (self.pelvis,)
        tail = self.roles.joints(end)[:1] if end is not None else ()
        joints = [*begin, *self.roles.joints(role), *tail]
        if len(joints) == 1:
            return Chain(joints, [0.0])
        bones = np.diff(self.tpose_positions[joints], axis=0)
        *arc, length = np.cumsum(np.linalg.norm(bones, axis=1)).tolist()
        return Chain(joints, [0.0, *(a / (length or 1.0) for a in arc), 1.0])

    @cached_property
    def doubles(self) -> dict[int, int]:
        """For each joint that doubles one with a role, that one: they turn alike."""
        return doubles_of(self.skeleton, self.roles.roles)

    def carried_by(self, joint: int) -> set[int]:
        """The joint and all below it, and its doubles and all below those."""
        tops = (joint, *(j for j, own in self.doubles.items() if own == joint))
        return {below for top in tops for below in self.skeleton.subtree(top)}

    @cached_property
    def fingers(self) -> dict[FingerBone, int]:
        """The joints of the fingers, as far as names tell them."""
        return finger_bones(self.skeleton, self.roles)

    @cached_property
    def palms(self) -> dict[int, int]:
        """For each hand, the joint that its fingers turn with: itself, as a rule."""
        return palms_of(self.skeleton, self.roles)

    @cached_property
    def twist_bones(self) -> dict[int, TwistBone]:
        """The joints that spread a limb's twist along its segments, and how they turn."""
        return twist_bones(self.skeleton, self.roles, self.tpose_positions)

    @cached_property
    def contact_joints(self) -> list[int]:
        """The joint of each foot that touches the floor: its toe, or the ankle without one."""
        pairs = ((self.roles.joint(toe), self.roles.joint(foot)) for foot, toe in FEET.values())
        return [j for toe, foot in pairs if (j := foot if toe is None else toe) is not None]


def understand(motion: Motion, override: Override | None = None) -> Rig:
    """What the skeleton of `motion` is: no configuration, names and geometry say it.

    Raises SkeletonError with the reason where the body is not a humanoid. `override` is a role map
    as `spark.rig.role_assignment.assign_roles` takes it.
    """
    skeleton, motion = motion.skeleton, motion.thinned(_FRAMES)
    roles = assign_roles(skeleton, motion, override)
    tpose, notes = find_tpose(motion, roles)
    pelvis = roles.require(Role.PELVIS)
    root_joint = root_joint_of(skeleton, roles)
    height = hip_height(skeleton, roles, tpose)
    if height < _LOWEST_HIPS:
        raise SkeletonError(
            f"the hips are {height:.2g} m above the soles; expected legs with a length"
        )
    notes = (*roles.notes, *notes)
    if lower := below_ankles(skeleton, roles, tpose):
        height += lower
        notes += (
            f"the feet end at the ankles: soles are taken to be {100 * lower:.1f} cm below these, "
            "by the shanks, as on a human",
        )
    if others := other_bodies(motion, roles):
        notes += (
            f"the file holds several bodies: the one of {skeleton.names[pelvis]!r} is used, and "
            f"not {name_list([skeleton.names[j] for j in others])}, which in a result stands "
            "still; to use another, split the file",
        )
    return Rig(skeleton, roles, groups_of(skeleton, roles), tpose, root_joint, height, notes)
