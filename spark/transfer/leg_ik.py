"""Two-bone inverse kinematics of legs and arms, and the corrections that hold planted feet.

Works on rotations since the T-pose in world axes, for any leading batch axes. A foot's contact
point (its toe, or its ankle where there is no toe) is held in one position over each stance;
between stances the correction is eased from one to the next. The leg bends in its own plane; the
foot keeps its rotation in the world. So it is of an arm: what is said of thigh, shank and ankle
holds of upper arm, forearm and wrist.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from spark.blocks import in_blocks
from spark.rig.rig import Rig
from spark.rig.roles import LIMBS, Group
from spark.rotation import quat_between, quat_mul, quat_rotate
from spark.smoothstep import smoothstep
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.vectors import cross, dot, joined, planes, seen

_STRAIGHT = 0.15  # sine of the knee's angle; the further below, the less the bones show its plane
_SOFT = 0.05  # [rad] 3 degrees: a knee that bends by less makes a leg .3 thousandths shorter
# About which a limb bends in the T-pose: knees to the back, elbows to the front.
KNEES = (0.0, 1.0, 0.0)
ELBOWS = {Group.LEFT_ARM: (0.0, 0.0, -1.0), Group.RIGHT_ARM: (0.0, 0.0, 1.0)}


class Leg(NamedTuple):
    """Joints of one leg, thigh to contact point, the joints that turn with thigh and shank, and the
    axis that the knee bends about, of the thigh in the T-pose."""

    upper_leg: int
    lower_leg: int
    foot: int
    contact: int
    with_thigh: tuple[int, ...]
    with_shank: tuple[int, ...]
    bends_about: tuple[float, float, float] = KNEES


def leg_of(rig: Rig, limb: Group) -> Leg | None:
    """The leg `limb` of a rig; None without a knee or an ankle."""
    upper, lower, foot, toe = (rig.roles.joint(role) for role in LIMBS[limb])
    return _limb_of(rig, upper, lower, foot, toe, KNEES)


def arm_of(rig: Rig, limb: Group) -> Leg | None:
    """The arm `limb` of a rig as a leg, its contact point the wrist; None without an elbow or a
    wrist."""
    _, upper, lower, hand = (rig.roles.joint(role) for role in LIMBS[limb])
    return _limb_of(rig, upper, lower, hand, hand, ELBOWS[limb])


def _limb_of(
    rig: Rig,
    upper: int | None,
    lower: int | None,
    foot: int | None,
    contact: int | None,
    bends_about: tuple[float, float, float],
) -> Leg | None:
    if upper is None or lower is None or foot is None:
        return None
    below_hip, below_knee, below_ankle = map(rig.carried_by, (upper, lower, foot))
    return Leg(
        upper,
        lower,
        foot,
        foot if contact is None else contact,
        tuple(sorted(below_hip - below_knee)),
        tuple(sorted(below_knee - below_ankle)),
        bends_about,
    )


def stance_correction(
    contact_pos: Float[np.ndarray, "*n T 3"],
    wanted_pos: Float[np.ndarray, "*n T 3"],
    planted: Bool[np.ndarray, "*n T"],
) -> Float[np.ndarray, "*n T 3"]:
    """What must be added to contact points' paths so that over each stance they rest at the mean of
    the wanted path [same unit]; eased from one to the next in between, held at both ends."""
    frames = np.flatnonzero(planted)  # of all paths, one after the other
    if not len(frames):
        return np.zeros_like(contact_pos)
    goes_on = np.concatenate([np.zeros_like(planted[..., :1]), planted[..., :-1]], -1)
    starts = np.flatnonzero(~goes_on.reshape(-1)[frames])
    counts = np.diff(starts, append=len(frames))
    before, after, ease = _neighbours(frames, planted)
    wanted, at = (planes(pos).reshape(3, -1).take(frames, 1) for pos in (wanted_pos, contact_pos))
    means = np.add.reduceat(wanted, starts, 1, dtype=np.float64) / counts
    held = means.repeat(counts, 1).astype(at.dtype) - at
    last = held.take(before, 1)
    some, ease = planted.any(-1, keepdims=True), ease.astype(at.dtype)
    eased = (last + ease * (held.take(after, 1) - last)).reshape(3, *planted.shape)
    return seen(eased * some)


def _neighbours(
    frames: Int[np.ndarray, "M"], known: Bool[np.ndarray, "*n T"]
) -> tuple[Int[np.ndarray, "N"], Int[np.ndarray, "N"], Float[np.ndarray, "N"]]:
    """For each frame of each path, which of the `frames` that are `known` is the last one up to it,
    which one the next from it on, and how far it is from the one to the other, eased. Before the
    first and after the last both are that one; in a path without any they are of another path."""
    size, T = known.size, known.shape[-1]
    time, first = np.arange(size), np.repeat(np.arange(0, size, T), T)
    rank = known.reshape(-1).cumsum()
    before, after = np.maximum(rank - 1, 0), np.minimum(rank - known.reshape(-1), len(frames) - 1)
    none_before = (frames[before] < first) | (frames[before] > time)
    before = np.where(none_before, after, before)
    none_after = (frames[after] >= first + T) | (frames[after] < time)
    after = np.where(none_after, before, after)
    since, until = frames[before], frames[after]
    return before, after, smoothstep((time - since) / np.maximum(until - since, 1))


def move_ankles(
    motion: CanonicalMotion, moves: Sequence[tuple[Leg, Float[np.ndarray, "T 3"]]]
) -> CanonicalMotion:
    """`motion` with the ankles of some legs moved by so much [m], or as near to it as they
    reach."""
    joints = [j for leg, _ in moves for j in leg[:3]]

    def bent(block: slice) -> Float[np.ndarray, "T J 4"]:
        part = motion.picked(block)
        out, positions = part.rotations.copy(), canonical_positions(part, joints)
        for (leg, move), k in zip(moves, range(0, len(joints), 3), strict=True):
            hip, knee, ankle = positions[:, k : k + 3].swapaxes(0, 1)
            upper_leg = out[:, leg.upper_leg]
            both = leg_rotations(knee - hip, ankle - knee, upper_leg, move[block], leg.bends_about)
            for moved, turned in zip((leg.with_thigh, leg.with_shank), both, strict=True):
                out[:, moved] = quat_mul(turned[:, None], out[:, moved])
        return out

    return replace(motion, rotations=in_blocks(bent, len(motion)))


def leg_rotations(
    thigh: Float[np.ndarray, "*n 3"],
    shank: Float[np.ndarray, "*n 3"],
    upper_leg: Float[np.ndarray, "*n 4"],
    move: Float[np.ndarray, "*n 3"],
    bends_about: tuple[float, float, float] = KNEES,
) -> tuple[Float[np.ndarray, "*n 4"], Float[np.ndarray, "*n 4"]]:
    """By which thigh and shank are turned, in world axes, so that the ankle moves by `move` or as
    near to it as the leg reaches. `thigh` and `shank` are the bones [m, world], `upper_leg` is the
    thigh's rotation since the T-pose, where the knee bends about `bends_about`. A leg that is not
    moved stays as it is."""
    a, b = _length(thigh), _length(shank)
    goal = thigh + shank + move
    reach = np.maximum(_length(goal), abs(a - b) * 1.01 + 1e-9)
    normal = cross(thigh, shank)
    lateral = quat_rotate(upper_leg, np.array(bends_about, normal.dtype))
    axis = _bend_axis(normal, a * b, lateral)
    # Of the bones' product, what a turn about the axis leaves as it is, and what it changes.
    fixed = dot(thigh, axis) * dot(shank, axis)
    along, across = dot(thigh, shank) - fixed, dot(normal, axis)
    changed = np.maximum(np.sqrt(along**2 + across**2), 1e-12)
    bend = np.arctan2(across, along)
    wanted = (reach**2 - a**2 - b**2) / 2 - fixed
    exact = np.arccos(np.clip(wanted / changed, -1.0, 1.0))
    turn = _turn_about(axis, _bent(bend, exact) - bend)
    swing = quat_between(thigh + quat_rotate(turn, shank), goal)
    return swing, quat_mul(swing, turn)


def _turn_about(
    axis: Float[np.ndarray, "*n 3"], angle: Float[np.ndarray, "*n 1"]
) -> Float[np.ndarray, "*n 4"]:
    """A turn about a unit axis [rad]."""
    cos, sin = np.cos(angle / 2)[..., 0], np.sin(angle / 2)[..., 0]
    return joined([cos, *(sin * axis[..., i] for i in range(3))], axis)


def _bend_axis(
    normal: Float[np.ndarray, "*n 3"],
    product: Float[np.ndarray, "*n 1"],
    lateral: Float[np.ndarray, "*n 3"],
) -> Float[np.ndarray, "*n 3"]:
    """The axis that a knee bends about, forwards: `normal` to the bones, whose lengths have this
    `product`, on the thigh's left; the thigh's `lateral` axis the more, the straighter the leg, and
    the more it bends sideways: there neither side of its plane is the left."""
    size = np.maximum(_length(normal), 1e-12)
    along = dot(normal, lateral) / size
    sine = size / np.maximum(product, 1e-12)
    weight = smoothstep(sine / _STRAIGHT) * smoothstep(abs(along))
    axis = normal * (np.sign(along) * weight / size) + lateral * (1 - weight)
    return axis / _length(axis)


def _bent(
    bend: Float[np.ndarray, "*n 1"], exact: Float[np.ndarray, "*n 1"]
) -> Float[np.ndarray, "*n 1"]:
    """The knee's angle from straight [rad], forwards, from the one that it has and the one that the
    ankle's new distance from the hip asks for.

    That one asks for 5 degrees where a straight leg's ankle comes nearer by a millimetre, and bends
    either way: knees would tremble that are nearly straight, and jump where they pass through
    straight. So angles near 0 are rounded off, and a knee that a recording overstretches stays so
    while its ankle hardly moves, and bends forwards where it does."""
    over = np.minimum(bend, 0)
    moved = np.maximum(exact**2 - bend**2, 0) / (_SOFT**2 + over**2)
    angle: Float[np.ndarray, "*n 1"] = _rounded(exact) + (bend - _rounded(bend)) * np.exp(-moved)
    return angle


def _rounded(angle: Float[np.ndarray, "*n 1"]) -> Float[np.ndarray, "*n 1"]:
    """`abs(angle)` without its edge at 0, where this is `_SOFT`: a parabola up to twice that."""
    near = _SOFT + angle**2 / (4 * _SOFT)
    return np.where(abs(angle) < 2 * _SOFT, near, abs(angle))


def _length(v: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n 1"]:
    length: Float[np.ndarray, "*n 1"] = np.sqrt(dot(v, v))
    return length
