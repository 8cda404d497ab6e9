"""Twist bones on a target: a limb's twist spread along its segments, by `spark.rig.twist_bones`.

They turn last, when limbs, hands and feet are where they stay.
"""

from collections.abc import Collection
from dataclasses import replace

import numpy as np
from jaxtyping import Float
from scipy.ndimage import uniform_filter1d

from spark.errors import name_list
from spark.rig.rig import Rig
from spark.rotation import (
    quat_conj,
    quat_from_rotvec,
    quat_mul,
    quat_relative,
    quat_swing_twist,
    rotvec_from_quat,
)
from spark.transfer.analytic import correspond
from spark.transfer.canonical import CanonicalMotion

_TURN = 2 * np.pi
_WOUND = 0.75 * _TURN  # no limb twists so far from the T-pose
_UNWINDING = 0.5  # [s] in which a turn is given back


def spread_twists(source: Rig, moved: CanonicalMotion) -> CanonicalMotion:
    """`moved`, a motion from `source`, with the twist bones of its rig turned that `source` lacks.

    Those of the same name in the same place turn as the source's do already. No joint that holds a
    role turns otherwise than before.
    """
    bones = moved.rig.twist_bones
    if not bones:
        return moved
    first = correspond(source, moved.rig).first
    names, theirs = moved.rig.skeleton.names, source.skeleton.names
    lacking = [j for j in bones if theirs[first[j]] != names[j]]
    if not lacking:
        return moved
    note = (
        f"{name_list([names[j] for j in lacking])}: twist bones that the source lacks, they take "
        "their share of their limb's twist or bend"
    )
    return replace(turn_bones(moved, lacking), notes=(*moved.notes, note))


def turn_bones(motion: CanonicalMotion, joints: Collection[int]) -> CanonicalMotion:
    """The motion with these twist bones of its rig turned, and with them what hangs on them, but
    for joints with a role and what these carry."""
    rig, rotations = motion.rig, motion.rotations
    out = rotations.copy()
    held = {j for j, role in enumerate(rig.roles.roles) if role is not None}
    parts: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]] = {}
    for j in sorted(joints):
        bone = rig.twist_bones[j]
        pair = (bone.above, bone.below)
        if pair not in parts:
            relative = quat_relative(*(rotations[:, end] for end in pair))
            swing, twist = quat_swing_twist(relative, bone.axis)
            angle = 2 * np.arctan2(twist[:, 1:] @ bone.axis, twist[:, 0])
            parts[pair] = rotvec_from_quat(swing), continuous_twist(angle, motion.frame_time)
        swing, angle = parts[pair]
        against = quat_mul(
            quat_from_rotvec(bone.swing * swing),
            quat_from_rotvec(bone.twist * angle[:, None] * bone.axis),
        )
        out[:, j] = quat_mul(rotations[:, bone.above], against)
        turned = quat_mul(out[:, j], quat_conj(rotations[:, j]))
        carried = {
            k
            for top in held.intersection(rig.skeleton.subtree(j))
            for k in rig.skeleton.subtree(top)
        }
        for k in rig.skeleton.subtree(j)[1:]:
            if k not in rig.twist_bones and k not in carried:
                out[:, k] = quat_mul(turned, rotations[:, k])
    return replace(motion, rotations=out)


def continuous_twist(angle: Float[np.ndarray, "T"], frame_time: float) -> Float[np.ndarray, "T"]:
    """A twist [rad] that goes on past half a turn, where parts of it would jump otherwise.

    The motion's middle (median) is within half a turn. Where a twist goes further than a joint can,
    it has wound up and might stay so: that turn is given back, gently.
    """
    angle = np.unwrap(angle)
    angle = angle - _TURN * np.round(np.median(angle) / _TURN)
    turns = np.zeros_like(angle)
    while len(wound := np.flatnonzero(abs(angle - _TURN * turns) > _WOUND)):
        turns[wound[0] :] = np.round(angle[wound[0]] / _TURN)
    size = max(1, round(_UNWINDING / frame_time))
    return angle - _TURN * uniform_filter1d(turns, size, mode="nearest")
