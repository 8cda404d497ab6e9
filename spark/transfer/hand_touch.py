"""Hands that stay on what the source's touch: the own body, and each other.

Limbs that turn as the source's do bring the hands of a broad body apart where the source claps, and
put hands that rest on hips into them. Here wrists are moved to where the source's hands are against
what they touch, in the target's measure, and elbows follow by two-bone inverse kinematics.
Animation libraries copy turns, and have hands come apart.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from spark.rig.flesh import RADII
from spark.rig.rig import Rig
from spark.rig.roles import HANDS, LIMBS, Group, Role
from spark.smoothstep import smoothstep
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.leg_ik import ELBOWS, Leg, arm_of, move_ankles
from spark.transfer.reach import Moves, in_time, stretch_of, swing_gently
from spark.transfer.self_touch import (
    Paths,
    beside,
    knuckles_of,
    led_to,
    self_touches,
    sure,
)

_EASE = 0.15  # [s] before hands meet they begin to come nearer than copied turns bring them
_PASSES = 2  # what an arm that is too short leaves open, the other one closes
_GENTLY = 0.8  # of an arm's length, beyond which it straightens ever more slowly
_APART = 0.03  # standing heights that hands are off what they touch, at least, to be told: 5 cm


def with_touches(source: CanonicalMotion, moved: CanonicalMotion) -> CanonicalMotion:
    """`moved`, the transfer of `source`, with hands on what the source's touch: thighs, shanks and
    the sides of the trunk, and each other, in proportion to the arms. Itself where they touch
    nothing. A body's own motion comes back as it was; arms reach as far as they do."""
    arms = {LIMBS[g][-1]: arm for g in ELBOWS if (arm := arm_of(moved.rig, g)) is not None}
    theirs = _paths(source)
    moved = _on_body(source, theirs, moved, arms)
    if all(role in arms and source.rig.roles.joint(role) is not None for role in HANDS):
        moved = _on_each_other(source, theirs, moved, arms)
    return moved


def lost_touches(moved: CanonicalMotion, kept: CanonicalMotion) -> tuple[str, ...]:
    """A note of how far hands of `moved` are from where they touch what they should, in `kept`."""
    joints = [j for role in HANDS if (j := moved.rig.roles.joint(role)) is not None]
    ways = canonical_positions(moved, joints) - canonical_positions(kept, joints)
    off = np.linalg.norm(ways, axis=2).max(axis=1, initial=0.0)
    worst = int(off.argmax())
    if off[worst] < _APART * moved.rig.standing_height:
        return ()
    return (
        f"hands touch each other or the body in the source; here they are up to "
        f"{100 * off[worst]:.0f} cm off that (at {worst * moved.frame_time:.2f} s): "
        "--keep-touches (keep_touches=True) brings them there",
    )


def arm_length(rig: Rig) -> float:
    """From shoulder to wrist [m], along the bones."""
    joints = [rig.roles.joint(role) for role in LIMBS[Group.LEFT_ARM][1:]]
    rest = rig.skeleton.rest_positions
    chain = [rest[j] for j in joints if j is not None]
    return float(np.linalg.norm(np.diff(chain, axis=0), axis=1).sum())


def _on_body(
    source: CanonicalMotion, theirs: Paths, moved: CanonicalMotion, arms: dict[Role, Leg]
) -> CanonicalMotion:
    """`moved` with each hand where it touches the body."""
    touches = self_touches(source, theirs, moved.rig)
    if not touches:
        return moved
    rig, own = moved.rig, _paths(moved)
    scale = rig.standing_height / source.rig.standing_height
    moves = []
    for touch in (touch for touch in touches if touch.hand in arms):
        arm = arms[touch.hand]
        middle = _middle(moved, own, touch.hand)
        chain = (*(own[j][0] for j in arm[:3]), middle[0])
        reach = float(np.linalg.norm(np.diff(chain, axis=0), axis=1).sum())
        ends = [[own[rig.roles.require(role)].T for role in part] for part in touch.parts]
        begins = [
            a + scale * away.T for (a, _), away in zip(ends, touch.away.swapaxes(0, 1), strict=True)
        ]
        lines = [b - a for a, b in ends]
        shoulder = own[arm.upper_leg].T
        there, share = led_to(touch, begins, lines, shoulder, reach, moved.frame_time)
        moves.append((arm, (share * (there - middle.T)).T))
    return _reaching(moved, moves, [_stretch(moved, arm) for arm, _ in moves])


def _on_each_other(
    source: CanonicalMotion, theirs: Paths, moved: CanonicalMotion, arms: dict[Role, Leg]
) -> CanonicalMotion:
    """`moved` with hands that touch each other as far apart as the source's, by their arms."""
    share = _together(source, theirs)
    if not share.any():
        return moved
    left, right = (_middle(source, theirs, hand) for hand in HANDS)
    between = arm_length(moved.rig) / arm_length(source.rig) * (left - right)
    both = [arms[hand] for hand in HANDS]
    stretches = [_stretch(moved, arm) for arm in both]
    for _ in range(_PASSES):
        own = _paths(moved)
        left, right = (_middle(moved, own, hand) for hand in HANDS)
        way = share[:, None] * (between - (left - right)) / 2
        moved = _reaching(moved, list(zip(both, (way, -way), strict=True)), stretches)
    return moved


def _together(source: CanonicalMotion, paths: Paths) -> Float[np.ndarray, "T"]:
    """How surely (0 to 1) both hands touch: their middles or their knuckles are near each other."""
    middles = [_middle(source, paths, hand) for hand in HANDS]
    knuckles = [knuckles_of(source, paths, hand) for hand in HANDS]
    distance = np.linalg.norm([a - b for a, b in (middles, knuckles)], axis=2).min(axis=0)
    near = beside(source.rig, distance, 2 * RADII["hand"])
    return smoothstep(in_time(sure(near), _EASE, source.frame_time))


def _stretch(moved: CanonicalMotion, arm: Leg) -> Float[np.ndarray, "T"]:
    """How far an arm may stretch before it does so gently: as copied, and `_GENTLY` at least."""
    return np.maximum(stretch_of(moved, arm), _GENTLY)


def _reaching(
    moved: CanonicalMotion, moves: Moves, stretches: Sequence[Float[np.ndarray, "T"]]
) -> CanonicalMotion:
    """`moved` with its wrists moved as far as its arms, whose `stretches` were these, straighten
    gently."""
    free = np.zeros((len(moves), len(moved)), dtype=bool)
    return move_ankles(moved, swing_gently(moved, moves, stretches, free)) if moves else moved


def _middle(motion: CanonicalMotion, paths: Paths, hand: Role) -> Float[np.ndarray, "T 3"]:
    """The middle of a hand [m, world]."""
    return (paths[motion.rig.roles.require(hand)] + knuckles_of(motion, paths, hand)) / 2


def _paths(motion: CanonicalMotion) -> Paths:
    """Those of the joints of its limbs: of some rigs they are few."""
    roles = [role for limb in LIMBS.values() for role in limb]
    joints = [j for role in roles if (j := motion.rig.roles.joint(role)) is not None]
    positions = canonical_positions(motion, joints)
    return {j: positions[:, k] for k, j in enumerate(joints)}
