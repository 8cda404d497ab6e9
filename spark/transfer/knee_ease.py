"""Knees that bend as smoothly as the source's, where legs do what their soles ask for.

Near its full length a leg changes by a millimetre where its knee bends by five degrees. A foot that
trembles, or is seen to turn by some degrees from one frame to the next, would snap the knee: its
sole is to stay as high as it is. So what a knee bends more than the source's is the curve with the
least sum of two squares, of what the sole is off and of how the curve bends. A bent knee moves its
sole far, and does at once what that asks for; one that is nearly straight takes its time.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float
from scipy.linalg import solveh_banded

from spark.second_differences import second_differences
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.leg_ik import Leg
from spark.transfer.reach import Moves, airborne, length_and_ankle

_QUICK = 0.0175  # [s] within which a knee follows that is bent at a right angle
_LEAST = 0.05  # of its way for each degree, that of a knee which counts as straight
_UPRIGHT = 0.5  # of a leg's length that its ankle is below the hip joint: then it stands on it

_DOWN = np.array([0.0, 0.0, -1.0])


def ease_knees(
    motion: CanonicalMotion,
    moves: Moves,
    stretches: Sequence[Float[np.ndarray, "T"]],
    stands: Bool[np.ndarray, "L T"],
) -> Moves:
    """The `moves` [m] of ankles, for knees that bend as smoothly as the source's, whose legs are
    stretched so far (`spark.transfer.reach.stretch`).

    A foot that stands is raised or lowered for that, and one in the air goes along its leg.
    """
    eased: list[tuple[Leg, Float[np.ndarray, "T 3"]]] = []
    for (leg, move), theirs, here in zip(moves, stretches, stands, strict=True):
        length, away = length_and_ankle(motion, leg)
        goal = away + move
        far = np.linalg.norm(goal, axis=1)
        bend, their_bend = _bend(far / np.maximum(length, 1e-9)), _bend(theirs)
        moved = np.sin((bend + their_bend) / 4) / np.sin(np.pi / 4)
        more = smoothest(bend - their_bend, np.maximum(moved, _LEAST), _QUICK / motion.frame_time)
        reach = length * np.cos(np.clip(their_bend + more, 0.0, np.pi) / 2)
        along = goal / np.maximum(far, 1e-9)[:, None]
        held = (1 - airborne(here, motion.frame_time)) * np.clip(along @ _DOWN / _UPRIGHT, 0.0, 1.0)
        way = along + held[:, None] * (_DOWN - along)
        eased.append((leg, move + _to_reach(goal, way, reach)))
    return eased


def smoothest(
    wanted: Float[np.ndarray, "T"], weights: Float[np.ndarray, "T"], frames: float
) -> Float[np.ndarray, "T"]:
    """The curve x with the least sum of (`weights` (x - `wanted`))² and (`frames`² x'')²."""
    if len(wanted) < 3:
        return wanted
    bands = frames**4 * second_differences(len(wanted))
    bands[2] += weights**2
    curve: Float[np.ndarray, T] = solveh_banded(bands, weights**2 * wanted)
    return curve


def _bend(stretch: Float[np.ndarray, "T"]) -> Float[np.ndarray, "T"]:
    """The angle [rad] of a knee between equal bones, of a leg that is stretched so far."""
    return 2 * np.arccos(np.clip(stretch, 0.0, 1.0))


def _to_reach(
    goal: Float[np.ndarray, "T 3"], way: Float[np.ndarray, "T 3"], reach: Float[np.ndarray, "T"]
) -> Float[np.ndarray, "T 3"]:
    """What moves `goal` [m] along `way` until it is so far from the origin, or as near to that as
    it comes."""
    way = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
    near = (goal * way).sum(axis=1)
    across = (goal**2).sum(axis=1) - near**2
    further = np.sqrt(np.maximum(reach**2 - across, 0.0)) - near
    return further[:, None] * way
