"""Knees that bend as smoothly as the source's, where legs follow what their soles ask for.

Near its full length a leg changes by a millimetre where its knee bends by five degrees. So a foot
that trembles, or is seen to turn by some degrees between two frames, would snap the knee: its sole
is to stay as high as it is. What a knee bends more than the source's therefore follows its sole
over time: it is the curve that gives the least of two sums, of its changes and of what the sole is
off. A bent knee moves its sole by centimetres and follows at once; one that is nearly straight
hardly moves it, and takes its time.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float
from scipy.linalg import solveh_banded

from spark.transfer.canonical import CanonicalMotion
from spark.transfer.leg_ik import Leg
from spark.transfer.reach import Moves, airborne, length_and_ankle

# [s] in which a knee follows that is bent by a right angle
_QUICK = 0.018
_LEAST = 0.05  # of that one's way for each degree, of a straight one


def ease_knees(
    motion: CanonicalMotion,
    moves: Moves,
    stretches: Sequence[Float[np.ndarray, "T"]],
    stands: Bool[np.ndarray, "L T"],
) -> Moves:
    """The `moves` [m] of ankles, with knees that bend and stretch as smoothly as the source's,
    whose legs are stretched so far (`reach.stretch`).

    A foot that stands is only raised or lowered for it, and one in the air goes along its leg.
    """
    eased: list[tuple[Leg, Float[np.ndarray, "T 3"]]] = []
    for (leg, move), theirs, here in zip(moves, stretches, stands, strict=True):
        length, away = length_and_ankle(motion, leg)
        goal = away + move
        wanted = np.linalg.norm(goal, axis=1) / np.maximum(length, 1e-9)
        bend, theirs_bend = bend_of(wanted), bend_of(theirs)
        follows = np.maximum(np.sin((bend + theirs_bend) / 4) / np.sin(np.pi / 4), _LEAST)
        more = followed(bend - theirs_bend, follows, _QUICK / motion.frame_time)
        reach = length * np.cos(np.clip(theirs_bend + more, 0.0, np.pi) / 2)
        along = goal / np.maximum(np.linalg.norm(goal, axis=1, keepdims=True), 1e-9)
        held = (1 - airborne(here, motion.frame_time)) * np.maximum(-along[:, 2], 0.0)
        way = (1 - held)[:, None] * along - held[:, None] * np.array([0.0, 0.0, 1.0])
        way /= np.linalg.norm(way, axis=1, keepdims=True)
        near = (goal * way).sum(axis=1)
        across = (goal**2).sum(axis=1) - near**2
        further = np.sqrt(np.maximum(reach**2 - across, 0.0)) - near
        eased.append((leg, move + further[:, None] * way))
    return eased


def bend_of(stretch: Float[np.ndarray, "T"]) -> Float[np.ndarray, "T"]:
    """The angle [rad] of a knee between equal bones, of a leg so far stretched."""
    return 2 * np.arccos(np.clip(stretch, 0.0, 1.0))


def followed(
    wanted: Float[np.ndarray, "T"], weights: Float[np.ndarray, "T"], frames: float
) -> Float[np.ndarray, "T"]:
    """The curve x of the least sum of (weights (x - wanted))² + (frames² x'')²."""
    if len(wanted) < 3:
        return wanted
    bands = np.zeros((3, len(wanted)))
    bands[2] = weights**2
    stiff = frames**4
    for a, own in enumerate((1.0, -2.0, 1.0)):
        for b in range(3 - a):
            bands[2 - b, a + b : len(wanted) - 2 + a + b] += stiff * own * (1.0, -2.0, 1.0)[a + b]
    solved: Float[np.ndarray, T] = solveh_banded(bands, weights**2 * wanted)
    return solved
