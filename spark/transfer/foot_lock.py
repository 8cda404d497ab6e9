"""Foot lock: feet that stay where the source's feet stay, as high as they are.

Copied rotations on legs of other proportions make standing feet slide, float or sink. Here each
foot's contact point (its toe, or its ankle where one of the two rigs has no toe) is held over the
ground during each stance of the source, at its own mean position, and carried from one footprint to
the next (`spark.transfer.footfalls`). The lowest point of its sole is as high above the floor as
the source's is, scaled: while it stands and while it swings, whatever the length of the foot.
Where the source's own foot moves during a stance, the first `_CAPTURE_NOISE` from its mean position
is taken for noise and removed; what goes beyond is motion and kept.
"""

import numpy as np
from jaxtyping import Bool, Float

from spark.rig.contacts import planted_points
from spark.rig.rig import Rig
from spark.rig.roles import LIMBS, Group, Role
from spark.rotation import quat_mul, quat_rotate
from spark.runs import true_runs
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.footfalls import between_contacts, beyond
from spark.transfer.leg_ik import Leg, leg_of, move_ankles
from spark.transfer.reach import within_reach

_MIN_STANCE = 0.1  # [s] a shorter one is a swinging foot that is slow and low for a moment
_CAPTURE_NOISE = 0.03  # [hip heights] 3 cm of an adult
# [hip heights] that a sole may sink: half a centimetre of an adult. A foot that sinks further in
# the source is lifted.
_MAX_SINK = 0.005


def lock_feet(source: CanonicalMotion, moved: CanonicalMotion) -> CanonicalMotion:
    """`moved`, the transfer of `source`, with its feet held while the source's stand, and as high
    as the source's."""
    scale = moved.rig.hip_height / source.rig.hip_height
    moves: list[tuple[Leg, Float[np.ndarray, "T 3"]]] = []
    feet = []
    for group in (Group.LEFT_LEG, Group.RIGHT_LEG):
        leg = leg_of(moved.rig.skeleton, moved.rig.roles.roles, group)
        contact = _contact(source.rig, moved.rig, group)
        if leg is not None and contact is not None:
            feet.append((leg, _foot(source, group, contact[0]), _foot(moved, group, contact[1])))
    if not feet:
        return moved
    paths = np.stack([theirs for _, (theirs, _), _ in feet], axis=1)
    planted = planted_points(paths, source.frame_time, source.rig.standing_height)
    for s, (leg, (theirs, their_height), (own, own_height)) in enumerate(feet):
        stance = _stances(planted[:, s], source.frame_time)
        offset = np.zeros((len(own), 2))
        for start, stop in true_runs(stance):
            here = slice(start, stop)
            drift = beyond(scale * theirs[here, :2], _CAPTURE_NOISE * moved.rig.hip_height)
            offset[here] = own[here, :2].mean(0) + drift - own[here, :2]
        along = between_contacts(offset, stance, own[:, :2])
        height = np.maximum(scale * their_height, -_MAX_SINK * moved.rig.hip_height)
        moves.append((leg, np.column_stack([along, height - own_height])))
    return move_ankles(*within_reach(moved, moves))


def _foot(
    motion: CanonicalMotion, group: Group, contact: int
) -> tuple[Float[np.ndarray, "T 3"], Float[np.ndarray, "T"]]:
    """Where a foot's contact joint is [m, world], and how high the lowest point of its sole is over
    the floor [m]."""
    rig = motion.rig
    sole = next(sole for sole in rig.soles if sole.side == group.side)
    joints = [contact, *sole.joints.tolist()]
    positions = canonical_positions(motion, joints)
    world = quat_mul(motion.rotations[:, sole.joints], rig.tpose[sole.joints])
    lowest = (positions[:, 1:] + quat_rotate(world, sole.offsets))[..., 2].min(axis=1)
    return positions[:, 0], lowest - motion.floor_z


def _stances(planted: Bool[np.ndarray, "T"], frame_time: float) -> Bool[np.ndarray, "T"]:
    """The frames of stances that are long enough to be one."""
    kept = planted.copy()
    for start, stop in true_runs(planted):
        if (stop - start) * frame_time < _MIN_STANCE:
            kept[start:stop] = False
    return kept


def _contact(source: Rig, target: Rig, group: Group) -> tuple[int, int] | None:
    """The source's and the target's joint that touch the floor; None where one has no foot."""
    roles: tuple[Role, ...] = LIMBS[group][:1:-1]
    for role in roles:
        a, b = source.roles.joint(role), target.roles.joint(role)
        if a is not None and b is not None:
            return a, b
    return None
