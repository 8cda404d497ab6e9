"""Hands on their own body: on a knee, a thigh, a hip or the chest, where the source's are.

Limbs that point as the source's do lead hands of longer or shorter arms, and of other trunks, past
what they should be on.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int
from scipy.ndimage import gaussian_filter1d

from robots.kinematics import LinkPoses, forward_kinematics
from robots.model.morphology import Morphology
from robots.solver.holds import Holds, joined
from robots.solver.touching import touches_of
from robots.tree import Coordinates
from sim.body.anthropometry import RADII
from spark.rig.contacts import ADULT_HEIGHT
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_conj, quat_rotate
from spark.smoothstep import smoothstep
from spark.transfer.canonical import CanonicalMotion
from spark.vectors import unit

_SIDES = {"left": 1.0, "right": -1.0}  # and where the hand points in the T-pose, along y
# What hands touch: lines between two joints, and whose flesh is around them.
_TOUCHED = tuple(
    (Role(f"{side}_{upper}"), Role(f"{side}_{lower}"), RADII[flesh])
    for side in _SIDES
    for upper, lower, flesh in (
        ("upper_leg", "lower_leg", "upper_leg"),
        ("lower_leg", "foot", "lower_leg"),
        ("upper_leg", "upper_arm", "spine"),
    )
)
_HAND = 0.055  # standing heights, at least, from the wrist to where the fingers begin
_RANGE = 0.03  # standing heights from the flesh over which a touch fades, as exp(-(gap / range)²),
_SPEED = 0.4  # [m/s, of an adult] along what is touched over which it does as well,
_STEADY = 0.1  # [s] and for how long it has to last
_DOUBT, _SURE = 0.15, 0.65  # of what is left: below it is no touch, and above it certainly is one
_REACH = 0.97  # arm lengths from the shoulder that a hand is led to,
_STRETCH = 0.15  # and arm lengths beyond, over which it is led ever less


@dataclass(frozen=True, eq=False)
class SelfTouch:
    """What a hand of the source touches of its own body: K `parts`, lines between two joints; how
    far `along` each it does (0 to 1), where the middle of the robot's hand should be from there
    (`offsets` [m], world axes), and how surely it touches (`shares`, 0 to 1)."""

    hand: Role
    parts: tuple[tuple[Role, Role], ...]
    along: Float[np.ndarray, "T K"]
    offsets: Float[np.ndarray, "T K 3"]
    shares: Float[np.ndarray, "T K"]

    def at(self, frames: slice | Int[np.ndarray, "S"]) -> "SelfTouch":
        """That of some frames."""
        values = (self.along[frames], self.offsets[frames], self.shares[frames])
        return SelfTouch(self.hand, self.parts, *values)


class Palm(NamedTuple):
    """The middle of a hand, or the end of an arm without one: the `link` that carries it, its
    `place` in the rest pose [m], and how far [m] from the shoulder the arm reaches with it."""

    link: int
    place: Float[np.ndarray, "3"]
    reach: float


def self_touches(
    source: CanonicalMotion, positions: Float[np.ndarray, "T J 3"], robot: Morphology
) -> tuple[SelfTouch, ...]:
    """Of each hand that ever touches something; the source's joints are at `positions` [m, world].

    A hand touches what it is near to, stays with, and reaches across: arms that hang beside the
    thighs run along them. The robot's is then on the flesh of a person of its size, on the side on
    which the source's is; where the robot is thicker, collisions keep its hand off.
    """
    out = []
    for side in _SIDES:
        hand, elbow = Role(f"{side}_hand"), Role(f"{side}_forearm")
        wrist, above = (source.rig.roles.joint(role) for role in (hand, elbow))
        if wrist is None or above is None or palm_of(robot, hand) is None:
            continue
        forearm = unit(positions[:, wrist] - positions[:, above])
        ahead = np.array([0.0, _SIDES[side] * _knuckles(source.rig, side, wrist), 0.0])
        turns = source.rotations[:, source.rig.palms[wrist]]
        knuckles = positions[:, wrist] + quat_rotate(turns, ahead)
        middle, touched = (positions[:, wrist] + knuckles) / 2, []
        free = 1.0 - _on_other_arm(source, positions, middle, side)
        for upper, lower, flesh in _TOUCHED:
            ends = [source.rig.roles.joint(role) for role in (upper, lower)]
            if None in ends or None in [robot.rig.roles.joint(role) for role in (upper, lower)]:
                continue
            a, b = (positions[:, j] for j in ends)
            along, away = _from_line(middle, a, b)
            _, ahead_away = _from_line(knuckles, a, b)
            distance = np.linalg.norm([away, ahead_away], axis=2).min(axis=0)
            across = 1.0 - np.einsum("ti,ti->t", forearm, unit(b - a)) ** 2
            thick = flesh + RADII["hand"]
            share = free * across * _beside(source, distance, thick) * _slow(source, away)
            share = smoothstep((_over_time(source.frame_time)(share) - _DOUBT) / (_SURE - _DOUBT))
            if share.any():
                offset = thick * robot.rig.standing_height * unit(away)
                touched.append(((upper, lower), along, offset, share))
        if touched:
            parts, *values = zip(*touched, strict=True)
            along, offsets, shares = (np.stack(value, axis=1) for value in values)
            out.append(SelfTouch(hand, tuple(parts), along, offsets, shares))
    return tuple(out)


def on_itself(
    robot: Morphology, touches: Sequence[SelfTouch], q: Coordinates, frame_time: float
) -> Holds:
    """The holds of hands that touch what they should on the body as it is in `q`: where an arm does
    not reach as far along a thigh, nearer; to what it can't reach at all it is not led."""
    poses, holds = forward_kinematics(robot.tree, q), [Holds.none(len(q))]
    steadily = _over_time(frame_time)
    for touch in touches:
        palm, side = palm_of(robot, touch.hand), touch.hand.side
        assert palm is not None
        shoulder = _center(robot, poses, Role(f"{side}_upper_arm"))
        total, wanted = np.zeros(len(q)), np.zeros((3, len(q)))
        for k, (upper, lower) in enumerate(touch.parts):
            begin, end = (_center(robot, poses, role) for role in (upper, lower))
            first, line = begin + touch.offsets[:, k].T, end - begin
            along = steadily(_within(palm.reach, first - shoulder, line, touch.along[:, k]))
            there = first + along * line
            beyond = np.linalg.norm(there - shoulder, axis=0) / palm.reach - 1.0
            share = touch.shares[:, k] * np.exp(-((np.maximum(beyond, 0.0) / _STRETCH) ** 2))
            total += share
            wanted += share * there
        points = np.repeat(palm.place[:, None], len(q), axis=1)
        shares = np.repeat(np.minimum(total, 1.0)[None], 3, axis=0)
        wanted /= np.maximum(total, 1e-9)
        holds.append(Holds(np.array([palm.link]), points[None], wanted[None], shares[None]))
    return joined(holds)


@lru_cache(maxsize=32)
def palm_of(robot: Morphology, hand: Role) -> Palm | None:
    """None where there is no arm."""
    rig, touch = robot.rig, touches_of(robot).get(hand)
    wrist = rig.roles.joint(hand)
    arm = [rig.roles.joint(Role(f"{hand.side}_{part}")) for part in ("upper_arm", "forearm")]
    if touch is None or None in arm:
        return None
    place = touch.place
    if wrist is not None:
        ahead = np.array([0.0, _SIDES[hand.side] * _HAND / 2 * rig.standing_height, 0.0])
        place = place + quat_rotate(quat_conj(rig.tpose[wrist]), ahead)
    chain = [*(robot.centers[j] for j in arm if j is not None), touch.place, place]
    reach = _REACH * float(np.linalg.norm(np.diff(chain, axis=0), axis=1).sum())
    return Palm(touch.link, place, reach)


def _on_other_arm(
    source: CanonicalMotion,
    positions: Float[np.ndarray, "T J 3"],
    middle: Float[np.ndarray, "T 3"],
    side: str,
) -> Float[np.ndarray, "T"]:
    """How near (0 to 1) a hand is to the other forearm: folded arms are on each other, and reach
    what is below only together."""
    other = "right" if side == "left" else "left"
    ends = [source.rig.roles.joint(Role(f"{other}_{part}")) for part in ("forearm", "hand")]
    if None in ends:
        return np.zeros(len(middle))
    _, away = _from_line(middle, *(positions[:, j] for j in ends))
    thick = RADII["forearm"] + RADII["hand"]
    return _beside(source, np.linalg.norm(away, axis=1), thick)


def _beside(
    source: CanonicalMotion, distance: Float[np.ndarray, "T"], thick: float
) -> Float[np.ndarray, "T"]:
    """How near (0 to 1) a hand is to a line [m] with flesh around it, `thick` standing heights."""
    gap = np.maximum(distance / source.rig.standing_height - thick, 0.0)
    return np.asarray(np.exp(-((gap / _RANGE) ** 2)))


def _slow(source: CanonicalMotion, away: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T"]:
    """How slow (0 to 1) a hand is over what it is `away` from [m]."""
    moved = np.gradient(away, source.frame_time, axis=0) if len(away) > 1 else np.zeros_like(away)
    speed = np.linalg.norm(moved, axis=1) * ADULT_HEIGHT / source.rig.standing_height
    return np.exp(-_over_time(source.frame_time)((speed / _SPEED) ** 2))


def _over_time(frame_time: float) -> Callable[[Float[np.ndarray, "T"]], Float[np.ndarray, "T"]]:
    """A mean over about as long as a touch lasts."""
    return partial(gaussian_filter1d, sigma=_STEADY / frame_time, mode="nearest")


def _knuckles(rig: Rig, side: str, wrist: int) -> float:
    """How far [m] from the wrist the fingers begin."""
    begin = [j for bone, j in rig.fingers.items() if bone.side == side and bone.number == 1]
    away = np.abs(rig.tpose_positions[begin, 1] - rig.tpose_positions[wrist, 1])
    return float(np.max(away, initial=_HAND * rig.standing_height))


def _from_line(
    point: Float[np.ndarray, "T 3"], a: Float[np.ndarray, "T 3"], b: Float[np.ndarray, "T 3"]
) -> tuple[Float[np.ndarray, "T"], Float[np.ndarray, "T 3"]]:
    """Where on the line from `a` to `b` a point is nearest, 0 to 1, and where it is from there."""
    line = b - a
    square = np.maximum(np.einsum("ti,ti->t", line, line), 1e-9)
    along = np.clip(np.einsum("ti,ti->t", point - a, line) / square, 0.0, 1.0)
    return along, point - a - along[:, None] * line


def _within(
    reach: float,
    first: Float[np.ndarray, "3 T"],
    line: Float[np.ndarray, "3 T"],
    along: Float[np.ndarray, "T"],
) -> Float[np.ndarray, "T"]:
    """How far along a line that begins at `first`, 0 to 1, one reaches from the origin: `along`, or
    as near to it as can be."""
    square = np.maximum(np.einsum("it,it->t", line, line), 1e-9)
    nearest = -np.einsum("it,it->t", first, line) / square
    away = np.linalg.norm(first + nearest * line, axis=0)
    most = np.sqrt(np.maximum(reach**2 - away**2, 0.0) / square)
    return np.clip(nearest + np.clip(along - nearest, -most, most), 0.0, 1.0)


def _center(robot: Morphology, poses: LinkPoses, role: Role) -> Float[np.ndarray, "3 T"]:
    j = robot.rig.roles.require(role)
    return poses.point(int(robot.links[j]), robot.centers[j])
