"""Frames that repeat the one before while the body moves: a file of another rate, or one that
stutters. Speeds and forces show it as skating, tremble and wrenches, and none of them says why."""

import numpy as np
from jaxtyping import Bool, Float

from sim.report.smoothness import turns_between
from spark.blocks import in_blocks
from spark.motion import Motion
from spark.runs import true_runs
from spark.summary import counted

# [rad], [m] Files round: what turns and moves by less from one frame to the next stands still.
_SAME_TURN, _SAME_PLACE = 1e-4, 1e-5
# Repeated frames are a stutter that last so long [s] at most, between two in which some joint turns
# at this speed [rad/s] at least: who comes to rest does so by and by.
_LASTS, _LEAST_SPEED = 0.2, 0.5
_MANY = 0.25  # of the frames: it is the rate


def stutter_notes(motion: Motion, whose: str) -> tuple[str, ...]:
    """A note where frames of a motion, which is called `whose`, repeat the one before."""
    repeats = repeated_frames(motion)
    count = int(repeats.sum())
    if not count:
        return ()
    which = counted(count, "frame")
    words = "repeats" if count == 1 else "repeat"
    note = (
        f"{whose} stutters: {which} of {len(motion)} {words} the one before while it moves, the "
        f"first of them frame {int(repeats.argmax())}"
    )
    if count < _MANY * len(motion):
        return (note,)
    lasting = float(np.median([stop - start for start, stop in true_runs(repeats)]))
    rate = motion.fps / (1 + lasting)
    return (f"{note}: it is likely of {rate:.4g} fps, and not of {motion.fps:.4g}",)


def repeated_frames(motion: Motion) -> Bool[np.ndarray, "T"]:
    """Which frames are the one before again, in the midst of a move."""
    moved = in_blocks(lambda block: _moved(motion, block), len(motion))
    turns, still = moved[:, 0], (moved[:, 0] < _SAME_TURN) & (moved[:, 1] < _SAME_PLACE)
    still[0] = False
    fast = turns > _LEAST_SPEED * motion.frame_time
    repeats = np.zeros(len(motion), dtype=bool)
    for start, stop in true_runs(still):
        between = stop < len(motion) and fast[start - 1] and fast[stop]
        if between and (stop - start) * motion.frame_time <= _LASTS:
            repeats[start:stop] = True
    return repeats


def _moved(motion: Motion, block: slice) -> Float[np.ndarray, "T 2"]:
    """How far the joint that turns most turns [rad], and the root moves [m], from the frame
    before."""
    first = max(block.start - 1, 0)
    turns = turns_between(motion.rotations[first : block.stop]).max(axis=1)
    path = motion.root_pos[first : block.stop]
    steps = np.linalg.norm(np.diff(path, axis=0, prepend=path[:1]), axis=1)
    return np.stack([turns, steps], axis=1)[block.start - first :]
