"""Where a long motion is cut: at breaks of the recording, and at moments of rest."""

from itertools import pairwise

import numpy as np
from jaxtyping import Float

from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.transfer.breaks import anew

WINDOW = 0.2  # [s] that must be calm around a cut
SHORTEST = 0.25  # of the longest piece: none is shorter


def pieces(motion: Motion, rig: Rig, longest: float) -> list[tuple[int, int]]:
    """The frames [start, stop) of pieces of at most `longest` seconds, which cover the motion.

    Each cut is where the recording is broken, or where the body moves least in the second half of
    what a piece may take, so that other pieces are no shorter than half of `longest`, but for the
    last two. None is shorter than `SHORTEST`.
    """
    most = max(int(longest / motion.frame_time + 1e-6), 1)
    least = max(int(SHORTEST * most), 1)
    if len(motion) < 2 * least:
        return [(0, len(motion))]
    positions, world = forward(motion)
    moving = unrest(positions[:, rig.roles.held], rig.standing_height, motion.frame_time)
    broken = anew(world[:, rig.pelvis], positions[:, rig.hips].mean(1), motion.frame_time)
    cuts = [0]
    while True:
        here, left = cuts[-1], len(motion) - cuts[-1]
        last = min(most, left - least)
        ends = [frame for frame in broken if least <= frame - here <= last]
        if ends:
            cuts.append(ends[0])
        elif left > most:
            # A break soon after is cut next: what lies before it must be long enough.
            reached = min(last + least, left - least)
            soon = [frame - here for frame in broken if last < frame - here <= reached]
            last = min([last, *(after - least for after in soon)])
            first = min(most // 2, last)
            window = moving[here + first : here + last + 1]
            cuts.append(here + first + int(window.argmin()))
        else:
            break
    return list(pairwise([*cuts, len(motion)]))


def unrest(
    positions: Float[np.ndarray, "T J 3"], height: float, frame_time: float
) -> Float[np.ndarray, "T"]:
    """How fast joints [m, world] move around each frame: their mean speed in standing heights a
    second, over `WINDOW`. A cut between frames t - 1 and t is judged by t."""
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=-1).mean(axis=1)
    speed = np.concatenate([steps[:1], steps]) / (height * frame_time)
    half = max(int(WINDOW / 2 / frame_time), 1)
    total = np.concatenate([[0.0], np.cumsum(speed)])
    frames = np.arange(len(positions))
    low, high = np.maximum(frames - half, 0), np.minimum(frames + half, len(positions))
    return (total[high] - total[low]) / np.maximum(high - low, 1)
