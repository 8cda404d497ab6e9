"""Foot lock: feet that stay where the source's feet stay.

Copied rotations on legs of other proportions make standing feet slide, float or sink. Here each
foot's contact point (its toe, or its ankle where one of the two rigs has no toe) is held during
each stance of the source: over the ground at its mean position of that stance, in height as far
above its sole as the source's is above its own. Between stances the correction is blended. Where
the source's own foot moves during a stance, the first `_CAPTURE_NOISE` from its mean position is
taken for noise and removed; what goes beyond is motion and kept.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Bool, Float, Int

from spark.blocks import in_blocks
from spark.rig.contacts import planted_points
from spark.rig.rig import Rig
from spark.rig.roles import LIMBS, Group, Role
from spark.runs import true_runs
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.leg_ik import Leg, bend_leg, blend_between, leg_of

_MIN_STANCE = 0.1  # [s] a shorter one is a swinging foot that is slow and low for a moment
_CAPTURE_NOISE = 0.03  # [hip heights] 3 cm of an adult


def lock_feet(source: CanonicalMotion, moved: CanonicalMotion) -> CanonicalMotion:
    """`moved`, the transfer of `source`, with its feet held while the source's stand."""
    scale = moved.rig.hip_height / source.rig.hip_height
    moves: list[tuple[Leg, Float[np.ndarray, "T 3"]]] = []
    for group in (Group.LEFT_LEG, Group.RIGHT_LEG):
        leg = leg_of(moved.rig.skeleton, moved.rig.roles.roles, group)
        contact = _contact(source.rig, moved.rig, group)
        if leg is None or contact is None:
            continue
        from_joint, to_joint = contact
        path = canonical_positions(source, [from_joint])[:, 0] - [0, 0, source.floor_z]
        stance = _stances(
            planted_points(path, source.frame_time, source.rig.standing_height),
            source.frame_time,
        )
        frames = np.flatnonzero(stance)
        if not len(frames):
            continue
        counts = np.array([stop - start for start, stop in true_runs(stance)])
        desired = path[frames] * scale
        desired[:, 2] -= scale * _rest_height(source.rig, from_joint)
        rest_z = moved.floor_z + _rest_height(moved.rig, to_joint)
        current = canonical_positions(moved, [to_joint])[frames, 0] - [0, 0, rest_z]
        desired[:, :2] = _without_mean(desired[:, :2], counts)
        desired[:, :2] -= _clamped(desired[:, :2], _CAPTURE_NOISE * moved.rig.hip_height)
        current[:, :2] = _without_mean(current[:, :2], counts)
        moves.append((leg, blend_between(desired - current, frames, len(moved))))

    def bent(block: slice) -> Float[np.ndarray, "T J 4"]:
        rotations, positions = moved.rotations[block], canonical_positions(moved.picked(block))
        for leg, move in moves:
            rotations = bend_leg(rotations, positions, leg, move[block])
        return rotations

    return replace(moved, rotations=in_blocks(bent, len(moved)))


def _without_mean(
    path: Float[np.ndarray, "P 2"], counts: Int[np.ndarray, "S"]
) -> Float[np.ndarray, "P 2"]:
    """A path over S stances of so many frames, each relative to its own mean position."""
    starts = np.cumsum(counts) - counts
    means = np.add.reduceat(path, starts) / counts[:, None]
    return path - np.repeat(means, counts, axis=0)


def _clamped(path: Float[np.ndarray, "P 2"], radius: float) -> Float[np.ndarray, "P 2"]:
    """Each vector, cut off at length `radius`."""
    length = np.linalg.norm(path, axis=-1, keepdims=True)
    return path * np.minimum(1.0, radius / np.maximum(length, 1e-12))


def _stances(planted: Bool[np.ndarray, "T"], frame_time: float) -> Bool[np.ndarray, "T"]:
    """The frames of stances that are long enough to be one."""
    kept = planted.copy()
    for start, stop in true_runs(planted):
        if (stop - start) * frame_time < _MIN_STANCE:
            kept[start:stop] = False
    return kept


def _contact(source: Rig, target: Rig, group: Group) -> tuple[int, int] | None:
    """The source's and the target's joint that touch the floor."""
    roles: tuple[Role, ...] = LIMBS[group][:1:-1]
    for role in roles:
        a, b = source.roles.joint(role), target.roles.joint(role)
        if a is not None and b is not None:
            return a, b
    return None


def _rest_height(rig: Rig, joint: int) -> float:
    """A joint's height [m] above the sole in the T-pose."""
    rest = rig.tpose_positions
    return float(rest[joint, 2] - rest[rig.hips, 2].mean() + rig.hip_height)
