"""Hands on their own body: on a knee, a thigh, a hip or the side of the trunk.

Limbs that point as the source's do lead hands of longer or shorter arms, and of other trunks, past
what they should be on.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from jaxtyping import Float, Int
from scipy.ndimage import gaussian_filter1d

from spark.rig.contacts import ADULT_HEIGHT
from spark.rig.flesh import RADII
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_rotate
from spark.smoothstep import smoothstep
from spark.transfer.canonical import CanonicalMotion
from spark.vectors import unit

SIDES = {"left": 1.0, "right": -1.0}  # and where the hand points in the T-pose, along y
# What hands touch: lines between two joints, and whose flesh is around them.
_TOUCHED = tuple(
    (Role(f"{side}_{upper}"), Role(f"{side}_{lower}"), RADII[flesh])
    for side in SIDES
    for upper, lower, flesh in (
        ("upper_leg", "lower_leg", "upper_leg"),
        ("lower_leg", "foot", "lower_leg"),
        ("upper_leg", "upper_arm", "spine"),
    )
)
HAND = 0.055  # standing heights, at least, from the wrist to where the fingers begin
_RANGE = 0.03  # standing heights from the flesh over which a touch fades, as exp(-(gap / range)²),
_SPEED = 0.4  # [m/s, of an adult] along what is touched over which it does as well,
_STEADY = 0.1  # [s] and for how long it has to last
_DOUBT, _SURE = 0.15, 0.65  # of what is left: below it is no touch, and above it certainly is one
_STRETCH = 0.15  # arm lengths beyond its reach, over which a hand is led ever less

Paths = Mapping[int, Float[np.ndarray, "T 3"]]
"""Where joints are [m, world], by the number of the joint."""


@dataclass(frozen=True, eq=False)
class SelfTouch:
    """What a hand of the source touches of its own body: K `parts`, lines between two joints with
    `flesh` of this thickness [standing heights] between line and hand; how far `along` each it
    does (0 to 1), where the middle of the source's hand is from there (`away` [m], world axes), and
    how surely it touches (`shares`, 0 to 1)."""

    hand: Role
    parts: tuple[tuple[Role, Role], ...]
    flesh: tuple[float, ...]
    along: Float[np.ndarray, "T K"]
    away: Float[np.ndarray, "T K 3"]
    shares: Float[np.ndarray, "T K"]

    def at(self, frames: slice | Int[np.ndarray, "S"]) -> "SelfTouch":
        """That of some frames."""
        values = (self.along[frames], self.away[frames], self.shares[frames])
        return SelfTouch(self.hand, self.parts, self.flesh, *values)


def self_touches(source: CanonicalMotion, paths: Paths, target: Rig) -> tuple[SelfTouch, ...]:
    """Of each hand that ever touches something that the `target` has, too; `paths` are those of the
    source's limbs.

    A hand touches what it is near to, stays with, and reaches across: arms that hang beside the
    thighs run along them.
    """
    out = []
    for side in SIDES:
        hand, elbow = Role(f"{side}_hand"), Role(f"{side}_forearm")
        wrist, above = (source.rig.roles.joint(role) for role in (hand, elbow))
        if wrist is None or above is None:
            continue
        forearm = unit(paths[wrist] - paths[above])
        knuckles = knuckles_of(source, paths, hand)
        middle, touched = (paths[wrist] + knuckles) / 2, []
        free = 1.0 - _on_other_arm(source, paths, middle, side)
        for upper, lower, flesh in _TOUCHED:
            ends = [source.rig.roles.joint(role) for role in (upper, lower)]
            if None in ends or None in [target.roles.joint(role) for role in (upper, lower)]:
                continue
            a, b = (paths[j] for j in ends if j is not None)
            along, away = _from_line(middle, a, b)
            _, ahead_away = _from_line(knuckles, a, b)
            distance = np.linalg.norm([away, ahead_away], axis=2).min(axis=0)
            thick = flesh + RADII["hand"]
            near = beside(source.rig, distance, thick)
            if near.max() <= _DOUBT:
                continue  # what follows only takes from it
            across = 1.0 - np.einsum("ti,ti->t", forearm, unit(b - a)) ** 2
            share = free * across * near * _slow(source, away)
            share = sure(_over_time(source.frame_time)(share))
            if share.any():
                touched.append(((upper, lower), thick, along, away, share))
        if touched:
            parts, thicknesses, *values = zip(*touched, strict=True)
            along, away, shares = (np.stack(value, axis=1) for value in values)
            out.append(SelfTouch(hand, tuple(parts), tuple(thicknesses), along, away, shares))
    return tuple(out)


def led_to(
    touch: SelfTouch,
    begins: Sequence[Float[np.ndarray, "3 T"]],
    lines: Sequence[Float[np.ndarray, "3 T"]],
    shoulder: Float[np.ndarray, "3 T"],
    reach: float,
    frame_time: float,
) -> tuple[Float[np.ndarray, "3 T"], Float[np.ndarray, "T"]]:
    """Where a hand is led that touches along `lines` from their `begins` on [m], one for each part,
    and how surely: nearer to the `shoulder` where the arm does not `reach` as far [m]; to what it
    can't reach at all it is not led."""
    total, wanted = np.zeros(len(touch.shares)), np.zeros((3, len(touch.shares)))
    steadily = _over_time(frame_time)
    for k, (begin, line) in enumerate(zip(begins, lines, strict=True)):
        along = steadily(_within(reach, begin - shoulder, line, touch.along[:, k]))
        there = begin + along * line
        beyond = np.linalg.norm(there - shoulder, axis=0) / reach - 1.0
        share = touch.shares[:, k] * np.exp(-((np.maximum(beyond, 0.0) / _STRETCH) ** 2))
        total += share
        wanted += share * there
    return wanted / np.maximum(total, 1e-9), np.minimum(total, 1.0)


def knuckles_of(motion: CanonicalMotion, paths: Paths, hand: Role) -> Float[np.ndarray, "T 3"]:
    """Where the fingers of a hand begin [m, world]."""
    rig, wrist = motion.rig, motion.rig.roles.require(hand)
    ahead = np.array([0.0, SIDES[hand.side] * _length(rig, hand.side, wrist), 0.0])
    return paths[wrist] + quat_rotate(motion.rotations[:, rig.palms[wrist]], ahead)


def _length(rig: Rig, side: str, wrist: int) -> float:
    """How far [m] from the wrist the fingers begin."""
    begin = [j for bone, j in rig.fingers.items() if bone.side == side and bone.number == 1]
    away = np.abs(rig.tpose_positions[begin, 1] - rig.tpose_positions[wrist, 1])
    return float(np.max(away, initial=HAND * rig.standing_height))


def beside(rig: Rig, distance: Float[np.ndarray, "T"], thick: float) -> Float[np.ndarray, "T"]:
    """How near (0 to 1) a hand is to what is at this distance [m], with flesh of `thick` standing
    heights between them."""
    gap = np.maximum(distance / rig.standing_height - thick, 0.0)
    return np.asarray(np.exp(-((gap / _RANGE) ** 2)))


def sure(share: Float[np.ndarray, "T"]) -> Float[np.ndarray, "T"]:
    """How surely (0 to 1) a hand touches what it is near to by this `share`."""
    return smoothstep((share - _DOUBT) / (_SURE - _DOUBT))


def _on_other_arm(
    source: CanonicalMotion,
    paths: Paths,
    middle: Float[np.ndarray, "T 3"],
    side: str,
) -> Float[np.ndarray, "T"]:
    """How near (0 to 1) a hand is to the other forearm: folded arms are on each other, and reach
    what is below only together."""
    other = "right" if side == "left" else "left"
    ends = [source.rig.roles.joint(Role(f"{other}_{part}")) for part in ("forearm", "hand")]
    if None in ends:
        return np.zeros(len(middle))
    _, away = _from_line(middle, *(paths[j] for j in ends if j is not None))
    thick = RADII["forearm"] + RADII["hand"]
    return beside(source.rig, np.linalg.norm(away, axis=1), thick)


def _slow(source: CanonicalMotion, away: Float[np.ndarray, "T 3"]) -> Float[np.ndarray, "T"]:
    """How slow (0 to 1) a hand is over what it is `away` from [m]."""
    moved = np.gradient(away, source.frame_time, axis=0) if len(away) > 1 else np.zeros_like(away)
    speed = np.linalg.norm(moved, axis=1) * ADULT_HEIGHT / source.rig.standing_height
    return np.exp(-_over_time(source.frame_time)((speed / _SPEED) ** 2))


def _over_time(frame_time: float) -> Callable[[Float[np.ndarray, "T"]], Float[np.ndarray, "T"]]:
    """A mean over about as long as a touch lasts."""
    return partial(gaussian_filter1d, sigma=_STEADY / frame_time, mode="nearest")


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
