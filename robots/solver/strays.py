"""Frames in which a source, or one of its joints, jumps away and back are passed over.

A T-pose that a converter put before the clip, for a frame or a second, a marker that was lost, a
thigh that turns the long way round for three frames: the solver's motions are smooth, so a pose
that nothing leads to would bend all around it. So are frames that a recorder dropped and filled
with the last one that it had.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import binary_dilation

from spark.blocks import in_blocks
from spark.kinematics import local_rotations, world_rotations
from spark.resample import rotations_at, values_at
from spark.rotation import quat_angle, quat_conj, quat_mul
from spark.runs import true_runs
from spark.summary import in_frames
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.stray_frames import jumps_of, repeats_of, strays_of

_LEAST_TURN = 1.0  # [rad] of a joint in its parent; glitches turn it by up to pi
_LEAST_TURN_SPEED = 40.0  # [rad/s]: wrists reach 30
_DROP_TIME = 0.2  # [s] up to which a body that stands still was not seen, and not at rest,
_LEAST_CATCH_UP = 0.01  # [hip heights] if its joints then go so far in the mean in one frame


def without_strays(source: CanonicalMotion) -> tuple[CanonicalMotion, tuple[str, ...]]:
    """`source` with what jumps away and back, or repeats the frame before, replaced by what lies
    between its neighbours, or, at an end of the motion, by the only one; and notes that say where.
    What jumps in half of the frames or more is left as it is, and so are jumps to where the motion
    goes on."""
    repeats = repeats_of(source)
    moving, dropped = _without_repeats(source, repeats)
    whole, note = _without_stray_frames(moving, repeats)
    joints, notes = _without_stray_joints(whole)
    return joints, (*dropped, *note, *notes)


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
    stray = strays_of(jumps_of(source), source.frame_time, repeats)
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
        if (stray := strays_of(jumped[:, k], source.frame_time)).any()
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
    return f" {in_frames(stray)}: the robot passes over that"
