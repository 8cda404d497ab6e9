"""Frames in which a source, or one of its joints, jumps away and back are passed over.

A T-pose that a converter put before the clip, for a frame or a second, a marker that was lost, a
thigh that turns the long way round for three frames: the solver's motions are smooth, so a pose
that nothing leads to would bend all around it. So are frames that a recorder dropped and filled
with the last one that it had.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import binary_dilation

from spark.blocks import in_blocks
from spark.kinematics import local_rotations, world_rotations
from spark.resample import rotations_at, values_at
from spark.rotation import quat_angle, quat_conj, quat_mul
from spark.runs import true_runs
from spark.summary import counted
from spark.transfer.canonical import CanonicalMotion, canonical_positions

_STRAY_TIME = 0.1  # [s] up to which frames between jumps belong to nothing
# A joint's step in the mean: from a T-pose into the motion 0.2 to 0.5 hip heights, at the quickest
# turn of a flip 0.15, but within 1/16 s.
_LEAST_STEP = 0.12  # [hip heights]
_LEAST_SPEED = 5.0  # [hip heights/s]
_LEAST_TURN = 1.0  # [rad] of a joint in its parent; glitches turn it by up to pi
_LEAST_TURN_SPEED = 40.0  # [rad/s]: wrists reach 30
_DROP_TIME = 0.2  # [s] up to which a body that stands still was not seen, and not at rest,
_LEAST_CATCH_UP = 0.01  # [hip heights] if its joints then go so far in the mean in one frame
_SAME = 1e-9  # [m], or of a quaternion


def without_strays(source: CanonicalMotion) -> tuple[CanonicalMotion, tuple[str, ...]]:
    """`source` with what jumps away and back, or repeats the frame before, replaced by what lies
    between its neighbours, or, at an end of the motion, by the only one; and notes that say where.
    What jumps in half of the frames or more is left as it is, and so are jumps to where the motion
    goes on."""
    repeats = _repeats(source)
    moving, dropped = _without_repeats(source, repeats)
    whole, note = _without_stray_frames(moving, repeats)
    joints, notes = _without_stray_joints(whole)
    return joints, (*dropped, *note, *notes)


def _repeats(source: CanonicalMotion) -> Bool[np.ndarray, "T"]:
    """Whether a frame is that before it."""

    def same(block: slice) -> Bool[np.ndarray, "N"]:
        part = source.picked(slice(max(block.start - 1, 0), block.stop))
        turned = np.abs(np.diff(part.rotations, axis=0)).max(axis=(1, 2), initial=0.0)
        moved = np.abs(np.diff(part.hips, axis=0)).max(axis=1, initial=0.0)
        own = np.maximum(turned, moved) < _SAME
        return own if block.start else np.append(False, own)

    return in_blocks(same, len(source))


def _without_repeats(
    source: CanonicalMotion, repeats: Bool[np.ndarray, "T"]
) -> tuple[CanonicalMotion, tuple[str, ...]]:
    dropped = repeats.copy()
    for start, stop in true_runs(repeats):
        short = start > 1 and stop < len(source) and stop - start <= _DROP_TIME / source.frame_time
        dropped[start:stop] = short and _way(source, stop) > _LEAST_CATCH_UP
    if not dropped.any():
        return source, ()
    note = f"the source repeats its last frame, as where frames were dropped,{_in(dropped)}"
    return _passed_over(source, dropped), (note,)


def _way(source: CanonicalMotion, frame: int) -> float:
    """How far [hip heights] the joints have come since the frame before, in the mean."""
    places = canonical_positions(source.frames(frame - 1, frame + 1), source.rig.roles.held)
    return float(np.linalg.norm(places[1] - places[0], axis=1).mean() / source.rig.hip_height)


def _passed_over(source: CanonicalMotion, frames: Bool[np.ndarray, "T"]) -> CanonicalMotion:
    rotations = _bridged(frames, source.rotations, rotations_at)
    return replace(source, rotations=rotations, hips=_bridged(frames, source.hips, values_at))


def _without_stray_frames(
    source: CanonicalMotion, repeats: Bool[np.ndarray, "T"]
) -> tuple[CanonicalMotion, tuple[str, ...]]:
    stray = _strays(_jumps(source), source.frame_time, repeats)
    if not stray.any():
        return source, ()
    note = f"the source jumps away from all other frames, as in a T-pose before a clip{_in(stray)}"
    return _passed_over(source, stray), (note,)


def _without_stray_joints(source: CanonicalMotion) -> tuple[CanonicalMotion, tuple[str, ...]]:
    rig = source.rig
    joints = rig.roles.held
    least = max(_LEAST_TURN, _LEAST_TURN_SPEED * source.frame_time)

    def local(frames: slice | Int[np.ndarray, "N"]) -> Float[np.ndarray, "N J 4"]:
        return local_rotations(rig.skeleton, quat_mul(source.rotations[frames], rig.tpose))

    def jumps(block: slice) -> Bool[np.ndarray, "N K"]:
        """Whether a joint comes to a frame by a jump."""
        start = max(block.start - 1, 0)
        turned = local(slice(start, block.stop))[:, joints]
        far = quat_angle(turned[:-1], turned[1:]) > least
        return far if block.start else np.concatenate([np.zeros((1, len(joints)), dtype=bool), far])

    jumped = in_blocks(jumps, len(source))
    strays = {
        j: stray
        for k, j in enumerate(joints)
        if (stray := _strays(jumped[:, k], source.frame_time)).any()
    }
    if not strays:
        return source, ()
    changed = np.any(list(strays.values()), axis=0)
    near = np.flatnonzero(binary_dilation(changed))  # of an hour, not all frames
    turned = local(near)
    for j, stray in strays.items():
        turned[:, j] = _bridged(stray[near], turned[:, j], rotations_at)
    rotations = source.rotations.copy()
    world = world_rotations(rig.skeleton, turned[changed[near]])
    rotations[changed] = quat_mul(world, quat_conj(rig.tpose))
    notes = [
        f"the source's {rig.skeleton.names[j]!r} turns away and back{_in(stray)}"
        for j, stray in strays.items()
    ]
    return replace(source, rotations=rotations), tuple(notes)


def _jumps(source: CanonicalMotion) -> Bool[np.ndarray, "T"]:
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


def _strays(
    jumps: Bool[np.ndarray, "T"],
    frame_time: float,
    repeats: Bool[np.ndarray, "T"] | None = None,
) -> Bool[np.ndarray, "T"]:
    """The frames in short pieces between two jumps, or between one and an end; there in pieces of
    any length that `repeats` tells to stand still: a pose that was put before a clip."""
    stray = np.zeros(len(jumps), dtype=bool)
    edges = np.flatnonzero(jumps).tolist()
    if not edges:
        return stray
    most = max(1, int(_STRAY_TIME / frame_time + 1e-6))
    for start, stop in pairwise([0, *edges, len(jumps)]):
        at_end = start == 0 or stop == len(jumps)
        still = at_end and repeats is not None and bool(repeats[start + 1 : stop].all())
        stray[start:stop] = stop - start <= most or still
    return stray & (2 * stray.sum() < len(stray))


def _bridged(
    stray: Bool[np.ndarray, "T"],
    values: Float[np.ndarray, "T *n"],
    between: Callable[[Float[np.ndarray, "K *n"], Float[np.ndarray, "N"]], np.ndarray],
) -> Float[np.ndarray, "T *n"]:
    """`values` with those of stray frames `between` the others around them."""
    kept = np.flatnonzero(~stray)
    out = values.copy()
    at = np.interp(np.flatnonzero(stray), kept, np.arange(len(kept)))
    out[stray] = between(values[kept], at)
    return out


def _in(stray: Bool[np.ndarray, "T"]) -> str:
    """` in 2 frames (7, 8): ...`."""
    frames = np.flatnonzero(stray).tolist()
    which = ", ".join(map(str, frames[:5])) + (", ..." if len(frames) > 5 else "")
    return f" in {counted(len(frames), 'frame')} ({which}): the robot passes over that"
