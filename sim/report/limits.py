"""Anatomical limits of the joints, by role, whatever the rig's joint axes and spine count are.

A joint's turn is its bone's rotation since the T-pose relative to that of the bone it hangs on, in
T-pose world axes; right limbs are mirrored into left ones. It is split into the twist about the
bone and the swing of it (Dobrowolski 2015), and the swing, a rotation vector across the bone, into
two components.

The ranges are those of the very mobile (AAOS "Joint Motion", Boone and Azen 1979, Kapandji) and 20
to 40 degrees more: a rig's joint centres and T-pose are not an anatomist's, and a limit that flags
captured people is worth nothing. They tell a knee that bends backwards, not a stiff one.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from sim.report.thresholds import PLAUSIBILITY
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_relative, quat_swing_twist, rotvec_from_quat
from spark.summary import brief

_X, _Y, _Z = 0, 1, 2


_Range = tuple[int, int]
_Movements = tuple[str, str]


@dataclass(frozen=True)
class JointLimit:
    """Ranges [deg] of one joint, of a left limb's or of the trunk's, by T-pose world axis.

    `axis` is the index of that along the bone: its range is that of the twist, the others are
    those of the swing. `below` holds the roles that the joint may hang on, the nearest first.
    `movements` say what a turn beyond either end of each range is called.
    """

    name: str
    role: str
    below: tuple[str, ...]
    axis: int
    ranges: tuple[_Range, _Range, _Range]
    movements: tuple[_Movements, _Movements, _Movements]
    paired: bool = True

    @property
    def sides(self) -> tuple[str, ...]:
        """ "left" and "right"; of the trunk "" alone."""
        return ("left", "right") if self.paired else ("",)

    def on(self, side: str) -> str:
        """What the joint is called on a side ("left knee")."""
        return f"{side} {self.name}".strip()


_TWISTS: _Movements = ("twists", "twists")
_SIDEWAYS: _Movements = ("bends sideways", "bends sideways")

# The signs follow from the T-pose (X forward, Y left, Z up): a left arm lies along +Y, so a turn
# about +X lifts it and one about -Z brings it forward; a leg hangs along -Z, so a turn about -Y
# swings it forward and one about +X moves a left leg outwards.
LIMITS: tuple[JointLimit, ...] = (
    JointLimit(
        "hip",
        "upper_leg",
        ("pelvis",),
        _Z,
        ((-60, 110), (-160, 60), (-90, 90)),
        (("swings inwards", "swings outwards"), ("flexes", "extends"), _TWISTS),
    ),
    JointLimit(
        "knee",
        "lower_leg",
        ("upper_leg",),
        _Z,
        ((-45, 45), (-25, 175), (-75, 75)),
        (_SIDEWAYS, ("bends backwards", "flexes"), _TWISTS),
    ),
    JointLimit(
        "ankle",
        "foot",
        ("lower_leg",),
        _X,
        ((-75, 75), (-65, 95), (-75, 75)),
        (_TWISTS, ("bends up", "bends down"), ("turns in", "turns out")),
    ),
    JointLimit(
        "shoulder",
        "upper_arm",
        ("spine", "pelvis"),
        _Y,
        ((-135, 140), (-170, 170), (-165, 100)),
        (("drops", "lifts"), _TWISTS, ("goes across", "goes back")),
    ),
    JointLimit(
        "elbow",
        "forearm",
        ("upper_arm",),
        _Y,
        ((-120, 120), (-170, 170), (-170, 40)),
        (_SIDEWAYS, _TWISTS, ("flexes", "bends backwards")),
    ),
    JointLimit(
        "wrist",
        "hand",
        ("forearm",),
        _Y,
        ((-120, 120), (-170, 170), (-80, 80)),
        (("flexes", "extends"), _TWISTS, _SIDEWAYS),
    ),
    JointLimit(
        "trunk",
        "spine",
        ("pelvis",),
        _Z,
        ((-70, 70), (-65, 120), (-90, 90)),
        (_SIDEWAYS, ("bends backwards", "bends forward"), _TWISTS),
        paired=False,
    ),
    JointLimit(
        "neck",
        "head",
        ("spine", "pelvis"),
        _Z,
        ((-80, 80), (-100, 100), (-120, 120)),
        (_SIDEWAYS, ("bends backwards", "bends forward"), _TWISTS),
        paired=False,
    ),
)


@dataclass(frozen=True, eq=False)
class LimitExcess:
    """How far one joint ("left knee") is beyond the ends of its ranges [rad]: `beyond[t, e]` is
    negative inside; `movements[e]` says what a turn beyond end e is called. It is at a limit where
    it is nearer to an end than `margin` [rad]."""

    joint: str
    beyond: Float[np.ndarray, "T E"]
    movements: tuple[str, ...]
    margin: float

    __repr__ = brief

    @property
    def excess(self) -> Float[np.ndarray, "T E"]:
        """How far outside its ranges the joint is [rad]; 0 inside."""
        return np.maximum(self.beyond, 0.0)

    @property
    def at_limit(self) -> Bool[np.ndarray, "T"]:
        """The frames in which the joint is at a limit or beyond."""
        return np.any(self.beyond > -self.margin, axis=1)

    @property
    def share(self) -> float:
        """The share of frames in which the joint is beyond a limit."""
        return float(np.any(self.beyond > 0, axis=1).mean())

    @property
    def at_limit_share(self) -> float:
        """The share of frames in which the joint is at a limit or beyond."""
        return float(self.at_limit.mean())


def limit_excess(since_tpose: Float[np.ndarray, "T J 4"], rig: Rig) -> tuple[LimitExcess, ...]:
    """The excess of each joint of `rig` that has a limit, from the rotations since the T-pose (G).

    A joint that the rig lacks, or that hangs on nothing, is left out.
    """
    excesses = []
    for limit in LIMITS:
        for side in limit.sides:
            joint = _joint(rig, side, limit.role)
            parent = next(
                (p for role in limit.below if (p := _joint(rig, side, role)) is not None), None
            )
            if joint is None or parent is None:
                continue
            rotation = quat_relative(since_tpose[:, parent], since_tpose[:, joint])
            if side == "right":
                rotation = rotation * np.array([1.0, -1.0, 1.0, -1.0])  # mirrored in the XZ plane
            excesses.append(
                LimitExcess(
                    limit.on(side),
                    _beyond(swing_and_twist(rotation, limit.axis), np.radians(limit.ranges)),
                    tuple(word for words in limit.movements for word in words),
                    PLAUSIBILITY.limit_margin,
                )
            )
    return tuple(excesses)


def swing_and_twist(rotation: Float[np.ndarray, "T 4"], axis: int) -> Float[np.ndarray, "T 3"]:
    """The twist [rad] about axis `axis` in its place, the swing's rotation vector in the others."""
    swing, twist = quat_swing_twist(rotation, np.eye(3)[axis])
    return rotvec_from_quat(swing) + rotvec_from_quat(twist)


def _beyond(
    angles: Float[np.ndarray, "T 3"], ranges: Float[np.ndarray, "3 2"]
) -> Float[np.ndarray, "T 6"]:
    return np.stack([ranges[:, 0] - angles, angles - ranges[:, 1]], axis=-1).reshape(-1, 6)


def joint_of_bone(bone: str) -> str:
    """What the joint is called that moves a bone with a role ("left lower leg": "left knee")."""
    side, _, part = bone.partition(" ")
    joints = {limit.role.replace("_", " "): limit.name for limit in LIMITS if limit.paired}
    return f"{side} {joints[part]}" if part in joints else bone


def limited_joint(rig: Rig, name: str) -> int | None:
    """The joint that a `LimitExcess` calls `name`."""
    for limit in LIMITS:
        for side in limit.sides:
            if limit.on(side) == name:
                return _joint(rig, side, limit.role)
    return None


def _joint(rig: Rig, side: str, role: str) -> int | None:
    """The outermost joint with the role; the trunk's roles have no side."""
    name = role if role in _UNPAIRED else f"{side}_{role}"
    joints = rig.roles.joints(Role(name))
    return joints[-1] if joints else None


_UNPAIRED = {Role.PELVIS, Role.SPINE, Role.NECK, Role.HEAD}
