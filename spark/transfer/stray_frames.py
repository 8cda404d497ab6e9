"""Frames that nothing leads to: a source jumps to them and away, or begins or ends with them, as
with a T-pose that a converter put before a clip, for a frame or a second."""

from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float

from spark.blocks import in_blocks
from spark.transfer.canonical import CanonicalMotion, canonical_positions

_STRAY_TIME = 0.1  # [s] up to which frames between jumps belong to nothing
# A joint's step in the mean: from a T-pose into the motion 0.2 to 0.5 hip heights, at the quickest
# turn of a flip 0.15, but within 1/16 s.
_LEAST_STEP = 0.12  # [hip heights]
_LEAST_SPEED = 5.0  # [hip heights/s]
_SAME = 1e-9  # [m], or of a quaternion


def repeats_of(source: CanonicalMotion) -> Bool[np.ndarray, "T"]:
    """Whether a frame is that before it."""

    def same(block: slice) -> Bool[np.ndarray, "N"]:
        part = source.picked(slice(max(block.start - 1, 0), block.stop))
        turned = np.abs(np.diff(part.rotations, axis=0)).max(axis=(1, 2), initial=0.0)
        moved = np.abs(np.diff(part.hips, axis=0)).max(axis=1, initial=0.0)
        own = np.maximum(turned, moved) < _SAME
        return own if block.start else np.append(False, own)

    return in_blocks(same, len(source))


def jumps_of(source: CanonicalMotion) -> Bool[np.ndarray, "T"]:
    """Whether a source jumps to a frame: its joints come there by a step that is long, and like
    neither the one before nor the one after."""
    rig, count = source.rig, len(source)
    if count < 3:
        return np.zeros(count, dtype=bool)
    least = max(_LEAST_STEP, _LEAST_SPEED * source.frame_time)

    def length(step: Float[np.ndarray, "N J 3"]) -> Float[np.ndarray, "N"]:
        return np.linalg.norm(step, axis=-1).mean(axis=-1) / rig.hip_height

    def far(block: slice) -> Bool[np.ndarray, "N"]:
        start, stop = max(block.start - 2, 0), min(block.stop + 1, count)
        steps = np.diff(canonical_positions(source.frames(start, stop), rig.roles.held), axis=0)
        changes = length(np.diff(steps, axis=0))
        nearest = np.minimum(np.append(np.inf, changes), np.append(changes, np.inf))
        own = np.append(0.0, np.minimum(nearest, length(steps)))
        return np.greater(own[block.start - start : block.stop - start], least)

    return in_blocks(far, count)


def strays_of(
    jumped: Bool[np.ndarray, "T"],
    frame_time: float,
    repeats: Bool[np.ndarray, "T"] | None = None,
) -> Bool[np.ndarray, "T"]:
    """The frames in short pieces between two jumps, or between one and an end; there in pieces of
    any length that `repeats` tells to stand still: a pose that was put before a clip."""
    stray = np.zeros(len(jumped), dtype=bool)
    edges = np.flatnonzero(jumped).tolist()
    if not edges:
        return stray
    most = max(1, int(_STRAY_TIME / frame_time + 1e-6))
    for start, stop in pairwise([0, *edges, len(jumped)]):
        at_end = start == 0 or stop == len(jumped)
        still = at_end and repeats is not None and bool(repeats[start + 1 : stop].all())
        stray[start:stop] = stop - start <= most or still
    return stray & (2 * stray.sum() < len(stray))
