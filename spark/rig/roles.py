"""What each joint of a skeleton is: its role on a human body, and the body part it belongs to."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property

from spark.errors import SkeletonError
from spark.summary import counted


class _Sided(StrEnum):
    """What a body has one of (`spine`) or, by its value's prefix, one on each side
    (`left_foot`)."""

    @cached_property
    def side(self) -> str:
        """ "left", "right", or "" on the midline."""
        side, _, _ = self.value.partition("_")
        return side if side in ("left", "right") else ""

    @cached_property
    def part(self) -> str:
        """The value without its side: "foot" of `left_foot`."""
        return self.value.removeprefix(f"{self.side}_") if self.side else self.value


class Role(_Sided):
    """The joints that humanoids share. `SPINE` and `NECK` may be held by several joints."""

    PELVIS = "pelvis"
    SPINE = "spine"
    NECK = "neck"
    HEAD = "head"
    LEFT_CLAVICLE = "left_clavicle"
    LEFT_UPPER_ARM = "left_upper_arm"
    LEFT_FOREARM = "left_forearm"
    LEFT_HAND = "left_hand"
    RIGHT_CLAVICLE = "right_clavicle"
    RIGHT_UPPER_ARM = "right_upper_arm"
    RIGHT_FOREARM = "right_forearm"
    RIGHT_HAND = "right_hand"
    LEFT_UPPER_LEG = "left_upper_leg"
    LEFT_LOWER_LEG = "left_lower_leg"
    LEFT_FOOT = "left_foot"
    LEFT_TOE = "left_toe"
    RIGHT_UPPER_LEG = "right_upper_leg"
    RIGHT_LOWER_LEG = "right_lower_leg"
    RIGHT_FOOT = "right_foot"
    RIGHT_TOE = "right_toe"

    @property
    def mirrored(self) -> "Role":
        """The same part on the other side; on the midline, itself."""
        other = {"left": "right", "right": "left"}.get(self.side)
        return Role(f"{other}_{self.part}") if other else self


class Group(_Sided):
    """The paper's six body parts (section 4.1)."""

    TORSO = "torso"
    LEFT_LEG = "left_leg"
    RIGHT_LEG = "right_leg"
    LEFT_ARM = "left_arm"
    RIGHT_ARM = "right_arm"
    HEAD = "head"


LIMBS: dict[Group, tuple[Role, ...]] = {
    Group.LEFT_LEG: (Role.LEFT_UPPER_LEG, Role.LEFT_LOWER_LEG, Role.LEFT_FOOT, Role.LEFT_TOE),
    Group.RIGHT_LEG: (Role.RIGHT_UPPER_LEG, Role.RIGHT_LOWER_LEG, Role.RIGHT_FOOT, Role.RIGHT_TOE),
    Group.LEFT_ARM: (
        Role.LEFT_CLAVICLE,
        Role.LEFT_UPPER_ARM,
        Role.LEFT_FOREARM,
        Role.LEFT_HAND,
    ),
    Group.RIGHT_ARM: (
        Role.RIGHT_CLAVICLE,
        Role.RIGHT_UPPER_ARM,
        Role.RIGHT_FOREARM,
        Role.RIGHT_HAND,
    ),
}
"""The four limbs, each from the body outwards."""
LIMB_OF = {role: group for group, limb in LIMBS.items() for role in limb}
LEGS = (Group.LEFT_LEG, Group.RIGHT_LEG)

ENDS = (Role.LEFT_CLAVICLE, Role.RIGHT_CLAVICLE, Role.LEFT_TOE, Role.RIGHT_TOE)
"""What lies before a limb's shoulder and after its ankle."""

CLAVICLES = (Role.LEFT_CLAVICLE, Role.RIGHT_CLAVICLE)
UPPER_ARMS = (Role.LEFT_UPPER_ARM, Role.RIGHT_UPPER_ARM)
HANDS = (Role.LEFT_HAND, Role.RIGHT_HAND)
UPPER_LEGS = (Role.LEFT_UPPER_LEG, Role.RIGHT_UPPER_LEG)
LOWER_LEGS = (Role.LEFT_LOWER_LEG, Role.RIGHT_LOWER_LEG)
ANKLES = (Role.LEFT_FOOT, Role.RIGHT_FOOT)

SURE = 0.8
"""Of a role's confidence: below it, one kind of evidence alone says it, or two disagree."""


@dataclass(frozen=True)
class RoleMap:
    """The role of each joint (None: it follows its parent), the confidence in [0, 1], and why; and
    notes on what was assumed."""

    roles: tuple[Role | None, ...]
    confidence: tuple[float, ...]
    reasons: tuple[str, ...]
    notes: tuple[str, ...] = ()

    def __repr__(self) -> str:
        return f"RoleMap({counted(len(self.roles), 'joint')}, {len(self.held)} with a role)"

    @cached_property
    def held(self) -> tuple[int, ...]:
        """The joints that hold a role."""
        return tuple(j for j, role in enumerate(self.roles) if role is not None)

    @cached_property
    def _joints(self) -> dict[Role, tuple[int, ...]]:
        found: dict[Role, list[int]] = {}
        for j, role in enumerate(self.roles):
            if role is not None:
                found.setdefault(role, []).append(j)
        return {role: tuple(joints) for role, joints in found.items()}

    def of(self, joints: Sequence[int]) -> "RoleMap":
        """The map of some joints alone."""
        return replace(
            self,
            roles=tuple(self.roles[j] for j in joints),
            confidence=tuple(self.confidence[j] for j in joints),
            reasons=tuple(self.reasons[j] for j in joints),
        )

    def joints(self, role: Role) -> tuple[int, ...]:
        """The joints that hold `role`, from the pelvis outwards; empty where there is none."""
        return self._joints.get(role, ())

    def joint(self, role: Role) -> int | None:
        """The first joint that holds `role`."""
        return next(iter(self.joints(role)), None)

    def require(self, role: Role) -> int:
        """The first joint that holds `role`; SkeletonError where there is none."""
        joint = self.joint(role)
        if joint is None:
            raise SkeletonError(
                f"no joint is the {role.value.replace('_', ' ')}; name it in a map file"
            )
        return joint


def limb_joints(roles: RoleMap, group: Group) -> list[int]:
    """The joints of a limb from hip or shoulder to ankle or wrist."""
    return [j for role in LIMBS[group] if role not in ENDS for j in roles.joints(role)]
