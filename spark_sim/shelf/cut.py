"""Where a long motion is cut: at moments of rest."""

from itertools import pairwise

import numpy as np
from jaxtyping import Float

from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import Rig

WINDOW = 0.2  # [s] that must be calm around a cut
SHORTEST = 0.25  # of the longest piece: what is left at the end is no shorter


def pieces(motion: Motion, rig: Rig, longest: float) -> list[tuple[int, int]]:
    """The frames [start, stop) of pieces of at most `longest` seconds, which cover the motion.

    Each cut is where the body moves least in the second half of what a piece may take, so that
    pieces are no shorter than half of `longest`, but for the last two.
    """
    most = max(int(longest / motion.frame_time + 1e-6), 1)
    least = max(int(SHORTEST * most), 1)
    if len(motion) <= most:
        return [(0, len(motion))]
    moving = unrest(motion, rig)
    cuts = [0]
    while (left := len(motion) - cuts[-1]) > most:
        last = min(most, left - least)
        first = min(most // 2, last)
        window = moving[cuts[-1] + first : cuts[-1] + last + 1]
        cuts.append(cuts[-1] + first + int(window.argmin()))
    cuts.append(len(motion))
    return list(pairwise(cuts))


def unrest(motion: Motion, rig: Rig) -> Float[np.ndarray, "T"]:
    """How fast the body moves around each frame: the mean speed of its joints with a role, in
    standing heights a second, over `WINDOW`. A cut between frames t - 1 and t is judged by t."""
    positions = forward(motion)[0][:, rig.roles.held]
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=-1).mean(axis=1)
    speed = np.concatenate([steps[:1], steps]) / (rig.standing_height * motion.frame_time)
    half = max(int(WINDOW / 2 / motion.frame_time), 1)
    total = np.concatenate([[0.0], np.cumsum(speed)])
    frames = np.arange(len(motion))
    low, high = np.maximum(frames - half, 0), np.minimum(frames + half, len(motion))
    return (total[high] - total[low]) / np.maximum(high - low, 1)
