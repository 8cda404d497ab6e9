"""What touches the ground beside the feet stays over it: hands, head, trunk and knees.

Copied onto arms and a trunk of other proportions, a body goes through the floor that the source's
rests on: in a cartwheel by its hands, if its arms are long for its legs. Where its feet are in the
air the body then rises as a whole, as it stands on its arms; and so it does where the trunk, the
head or a knee is too low, but for feet that stay where they are. A hand bends up at the wrist until
its fingers lie on the floor, and what is still too low is raised with the elbow.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from spark.blocks import in_blocks
from spark.rig.roles import LEGS, LIMBS, Role
from spark.rotation import quat_conj, quat_mul
from spark.smoothstep import smoothstep
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.hands_up import bent_up
from spark.transfer.knee_ease import ease_knees
from spark.transfer.leg_fit import from_sole
from spark.transfer.leg_ik import ELBOWS, Leg, arm_of, leg_of, move_ankles
from spark.transfer.reach import in_time, stretch_of

_FLESH = 0.005  # [hip heights] of a joint's centre over the floor, at least: half a cm of an adult
_EASE = 0.1  # [s] before something would be in the floor it begins to rise
_ALOFT = 0.15  # [hip heights] over where it stands at which a foot is in the air
_BODY = (
    *(Role.PELVIS, Role.HEAD, Role.LEFT_UPPER_ARM, Role.RIGHT_UPPER_ARM),
    *(role for leg in LEGS for role in LIMBS[leg][:2]),
)
_UP = np.array([0.0, 0.0, 1.0])


def over_floor(source: CanonicalMotion, moved: CanonicalMotion) -> CanonicalMotion:
    """`moved`, the transfer of `source`, with nothing in the floor that is not in the source's, but
    for its feet. Itself where that is so already."""
    arms = {LIMBS[g][-1]: arm for g in ELBOWS if (arm := arm_of(moved.rig, g)) is not None}
    body = {role: [j] for role in _BODY if (j := moved.rig.roles.joint(role)) is not None}
    hands = {role: list(moved.rig.skeleton.subtree(arm.foot)) for role, arm in arms.items()}
    least = _FLESH * moved.rig.hip_height
    if min(map(np.min, _lowest(moved, {**body, **hands}).values())) >= least:
        return moved
    allowed = _allowed(source, moved, [*body, *hands], least)
    if not any(map(np.any, _sunk(moved, {**body, **hands}, allowed).values())):
        return moved
    wrists = {role: joints[:1] for role, joints in hands.items()}
    moved = _risen(moved, _sunk(moved, body, allowed), _sunk(moved, wrists, allowed))
    moved = _turned_up(moved, hands, allowed)
    deep = _sunk(moved, hands, allowed)
    raised = [
        (arm, in_time(deep[role], _EASE, moved.frame_time)[:, None] * _UP)
        for role, arm in arms.items()
    ]
    return move_ankles(moved, raised)


def _allowed(
    source: CanonicalMotion, moved: CanonicalMotion, roles: Sequence[Role], least: float
) -> dict[Role, Float[np.ndarray, "T"]]:
    """How low [m] over the floor parts of `moved` may be: `least`, or as low as the source's,
    scaled, where that is lower."""
    rig = source.rig
    scale = moved.rig.hip_height / rig.hip_height
    joints = {role: j for role in roles if (j := rig.roles.joint(role)) is not None}
    parts = {r: rig.skeleton.subtree(j) if r.part == "hand" else [j] for r, j in joints.items()}
    return {r: np.minimum(scale * low, least) for r, low in _lowest(source, parts).items()}


def _sunk(
    moved: CanonicalMotion,
    parts: Mapping[Role, Sequence[int]],
    allowed: Mapping[Role, Float[np.ndarray, "T"]],
) -> dict[Role, Float[np.ndarray, "T"]]:
    """How much too low [m] parts are; those that the source lacks are not."""
    return {
        role: np.maximum(allowed[role] - low, 0.0) if role in allowed else np.zeros(len(low))
        for role, low in _lowest(moved, parts).items()
    }


def _lowest(
    motion: CanonicalMotion, parts: Mapping[Role, Sequence[int]]
) -> dict[Role, Float[np.ndarray, "T"]]:
    """The height over the floor [m] of the lowest of each part's joints."""
    joints = [j for part in parts.values() for j in part]
    heights = in_blocks(
        lambda block: canonical_positions(motion.picked(block), joints)[..., 2], len(motion)
    )
    starts = np.cumsum([0, *map(len, parts.values())])[:-1]
    lowest = np.minimum.reduceat(heights - motion.floor_z, starts, axis=1)
    return dict(zip(parts, lowest.T, strict=True))


def _risen(
    moved: CanonicalMotion,
    body: Mapping[Role, Float[np.ndarray, "T"]],
    wrists: Mapping[Role, Float[np.ndarray, "T"]],
) -> CanonicalMotion:
    """The whole body as high as its parts ask for, the wrists while no foot is near the floor; feet
    that are near it stay, as far as knees follow smoothly."""
    legs = [leg for group in LEGS if (leg := leg_of(moved.rig, group)) is not None]
    aloft = [_aloft(moved, leg) for leg in legs]
    on_hands = np.min([np.ones(len(moved)), *aloft], axis=0)
    asked = [*body.values(), *(on_hands * deep for deep in wrists.values())]
    most = np.max([np.zeros(len(moved)), *asked], axis=0)
    rise = in_time(most, _EASE, moved.frame_time)
    higher = replace(moved, hips=moved.hips + rise[:, None] * _UP)
    stay = [(leg, -((1 - own) * rise)[:, None] * _UP) for leg, own in zip(legs, aloft, strict=True)]
    stretches = [stretch_of(moved, leg) for leg in legs]
    down = np.ones((len(legs), len(moved)), dtype=bool)
    return move_ankles(higher, ease_knees(higher, stay, stretches, down))


def _aloft(moved: CanonicalMotion, leg: Leg) -> Float[np.ndarray, "T"]:
    """How far a foot is in the air: 0 where it stands, 1 at `_ALOFT` over that and more."""
    rig, foot = moved.rig, [leg.foot, leg.contact]
    high = canonical_positions(moved, foot)[..., 2].min(axis=1) - moved.floor_z
    standing = min(from_sole(rig, joint)[2] for joint in foot)
    return smoothstep((high - standing) / (_ALOFT * rig.hip_height))


def _turned_up(
    moved: CanonicalMotion,
    hands: Mapping[Role, Sequence[int]],
    allowed: Mapping[Role, Float[np.ndarray, "T"]],
) -> CanonicalMotion:
    """Hands bent up at the wrist until no finger is lower than it may be."""
    rotations = moved.rotations.copy()
    for role, joints in hands.items():
        if len(joints) > 1 and role in allowed:
            turned = bent_up(moved, joints, allowed[role])[:, None]
            own = rotations[:, joints[:1]]
            turned = quat_mul(quat_mul(own, turned), quat_conj(own))
            rotations[:, joints] = quat_mul(turned, rotations[:, joints])
    return replace(moved, rotations=rotations)
