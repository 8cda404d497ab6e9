"""Hips that come down to feet out of reach, and legs that stretch and fold gently.

A broad body on short legs takes longer steps than its legs alone would (`travel_scale`), and then
some of its feet stand where a leg does not reach: they would be pulled along, and lifted. People
lower their hips in a wide stance, and so does this. A foot that swings or rolls off is let go of:
the other leg would bend. But a knee that is bent in the source would snap straight on its way to a
place out of reach, and stay so until the foot is back. So but where its sole stands a leg stretches
further than the source's by a part of what is left of it only: its knee straightens as that does.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from spark.rig.roles import Group
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.leg_ik import Leg, leg_of

MAX_REACH = 0.999  # of a leg's length
_AHEAD = 0.15  # [s] before a foot is out of reach the hips begin to come down
_AIRBORNE = 0.05  # [s] after a sole has left the ground, or before it is put down, it swings
# Of a leg's length: its knee is bent by 120 degrees, and by 150, when the thigh lies on the calf.
_DEEP, _FOLDED = 0.5, 0.25
_MAX_DROP = 0.1  # [hip heights] of a wide stance; a foot further away is let go of

Moves = Sequence[tuple[Leg, Float[np.ndarray, "T 3"]]]


def within_reach(
    motion: CanonicalMotion, moves: Moves, stands: Bool[np.ndarray, "L #T"]
) -> tuple[CanonicalMotion, Moves]:
    """`motion` with its hips as low as its legs need them to move their ankles by `moves` [m] while
    they stand, and the moves from there."""
    drop = np.max(
        [here * _drop(motion, leg, move) for (leg, move), here in zip(moves, stands, strict=True)],
        axis=0,
    )
    if not drop.any():
        return motion, moves
    drop = in_time(drop, _AHEAD, motion.frame_time)
    down = drop[:, None] * np.array([0.0, 0.0, 1.0])
    lower = replace(motion, hips=motion.hips - down)
    return lower, [(leg, move + down) for leg, move in moves]


def stretch(motion: CanonicalMotion, group: Group) -> Float[np.ndarray, "T"]:
    """How far a leg's ankle is from its hip joint, over the leg's length; 1, that of a leg which
    can't stretch, without a knee or without length."""
    leg = leg_of(motion.rig, group)
    return np.ones(len(motion)) if leg is None else stretch_of(motion, leg)


def stretch_of(motion: CanonicalMotion, leg: Leg) -> Float[np.ndarray, "T"]:
    """The same of a leg that is known, or of an arm."""
    length, away = length_and_ankle(motion, leg)
    distance = np.linalg.norm(away, axis=1)
    return np.divide(distance, length, out=np.ones(len(motion)), where=length > 0)


def swing_gently(
    motion: CanonicalMotion,
    moves: Moves,
    stretches: Sequence[Float[np.ndarray, "T"]],
    stands: Bool[np.ndarray, "L T"],
) -> Moves:
    """The `moves` [m] of feet that swing or roll off, as far as their legs stretch for them gently:
    all but those of soles that stand.

    `stretches` are those of the source's legs. What a leg is to stretch further than that takes
    from what is left to its full length, left' = left exp(-further / left): nearly all of a little,
    and never all that is left.
    """
    gentle: list[tuple[Leg, Float[np.ndarray, "T 3"]]] = []
    for (leg, move), theirs, here in zip(moves, stretches, stands, strict=True):
        length, away = length_and_ankle(motion, leg)
        goal = away + move
        wanted = np.linalg.norm(goal, axis=1) / np.maximum(length, 1e-9)
        left = np.maximum(1.0 - theirs, 1e-9)
        further = np.maximum(wanted - theirs, 0.0)
        spared = np.maximum(further + left * np.expm1(-further / left), 0.0)
        shorter = airborne(here, motion.frame_time) * spared / np.maximum(wanted, 1e-9)
        gentle.append((leg, move - shorter[:, None] * goal))
    return gentle


def unfolded(
    motion: CanonicalMotion,
    moves: Moves,
    stretches: Sequence[Float[np.ndarray, "T"]],
    stands: Bool[np.ndarray, "L #T"],
) -> tuple[CanonicalMotion, Moves]:
    """`motion` with its hips so high that legs fold gently which stand with their ankles moved by
    `moves` [m], and the moves from there: big feet on short legs leave little between them.

    `stretches` are those of the source's legs. What a leg is to fold further than that, and than a
    deep bend, takes from what is left until its thigh lies on its calf, as in `swing_gently` at the
    other end.
    """
    rises = []
    for (leg, move), theirs, here in zip(moves, stretches, stands, strict=True):
        length, away = length_and_ankle(motion, leg)
        wanted = np.linalg.norm(away + move, axis=1) / np.maximum(length, 1e-9)
        deep = np.minimum(theirs, _DEEP)
        left = np.maximum(deep - _FOLDED, 1e-9)
        further = np.maximum(deep - wanted, 0.0)
        rises.append(here * length * np.maximum(further + left * np.expm1(-further / left), 0.0))
    rise = np.max(rises, axis=0)
    if not rise.any():
        return motion, moves
    up = in_time(rise, _AHEAD, motion.frame_time)[:, None] * np.array([0.0, 0.0, 1.0])
    return replace(motion, hips=motion.hips + up), [(leg, move - up) for leg, move in moves]


def airborne(stands: Bool[np.ndarray, "T"], frame_time: float) -> Float[np.ndarray, "T"]:
    """How far a foot swings or rolls off, 0 to 1: 0 where its sole stands."""
    return 1.0 - in_time(stands.astype(float), _AIRBORNE, frame_time)


def in_time(
    need: Float[np.ndarray, "T"], ahead: float, frame_time: float
) -> Float[np.ndarray, "T"]:
    """No less than what is needed in each frame, and begun `ahead` [s] of it: the mean of the
    largest need near each frame."""
    size = 2 * round(ahead / frame_time) + 1
    largest = maximum_filter1d(need, size, mode="nearest")
    eased: Float[np.ndarray, T] = uniform_filter1d(largest, size, mode="nearest")
    return eased


def _drop(
    motion: CanonicalMotion, leg: Leg, move: Float[np.ndarray, "T 3"]
) -> Float[np.ndarray, "T"]:
    """How far the hip has to come down for the leg to reach [m]."""
    length, away = length_and_ankle(motion, leg)
    # A leg that was stretched out as it was copied may stay so.
    reach = np.maximum(MAX_REACH * length, np.linalg.norm(away, axis=1))
    goal = away + move
    below = np.sqrt(np.maximum(reach**2 - goal[:, 0] ** 2 - goal[:, 1] ** 2, 0.0))
    return np.clip(-goal[:, 2] - below, 0.0, _MAX_DROP * motion.rig.hip_height)


def length_and_ankle(
    motion: CanonicalMotion, leg: Leg
) -> tuple[Float[np.ndarray, "T"], Float[np.ndarray, "T 3"]]:
    """A leg's length, and its ankle from its hip joint [m, world]."""
    at = canonical_positions(motion, [leg.upper_leg, leg.lower_leg, leg.foot])
    hip, knee, ankle = at[:, 0], at[:, 1], at[:, 2]
    length = np.linalg.norm(knee - hip, axis=1) + np.linalg.norm(ankle - knee, axis=1)
    return length, ankle - hip
