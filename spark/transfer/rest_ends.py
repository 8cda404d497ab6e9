"""Hands and feet as they rest, between bodies that rest in a T.

Makers let feet point outwards and hands ahead in the pose that they bind a body in, and that is how
it stands. Animation libraries put a motion on it from rest pose to rest pose: ankles of Mixamo are
turned further than from T-pose to T-pose by what the two rest poses differ in, to half a degree
(docs/evaluation.md). Bones of arms and legs follow the T-pose there, too, and so do hands that
droop: it is where hands and feet head over the ground that is kept. Rest poses that are none in a T
say nothing of how a body stands.
"""

from dataclasses import replace

import numpy as np

from spark.rig.rig import Rig
from spark.rig.roles import ANKLES, HANDS, LIMBS, Role, limb_joints
from spark.rotation import (
    quat_angle,
    quat_conj,
    quat_from_yaw,
    quat_identity,
    quat_mul,
    yaw_from_quat,
)
from spark.transfer.canonical import CanonicalMotion

# Arms and legs of 37 of Mixamo's characters rest within 10 degrees of the T-pose, those of CMU's
# skeletons 20; feet of the former point up to 22 degrees outwards.
_T = np.radians(15)
_BUILT = np.radians(30)
_ENDS = (*ANKLES, *HANDS)


def from_rest_to_rest(source: Rig, moved: CanonicalMotion) -> CanonicalMotion:
    """`moved`, whose joints turn since the T-pose as the source's do, with hands and feet that turn
    so since they head as in the rest pose, where both bodies rest in a T."""
    theirs, own = _headings(source), _headings(moved.rig)
    shared = [role for role in theirs if role in own]
    if not shared:
        return moved
    rotations = moved.rotations.copy()
    for role in shared:
        joints = sorted(moved.rig.carried_by(moved.rig.roles.require(role)))
        turn = quat_from_yaw(np.array(theirs[role] - own[role]))
        rotations[:, joints] = quat_mul(rotations[:, joints], turn)
    return replace(moved, rotations=rotations)


def _headings(rig: Rig) -> dict[Role, float]:
    """By what yaw [rad] hands and feet are turned from the rest pose to the T-pose; of a body that
    rests in another pose none, and no pair that rests bent."""
    # At rest all axes lie as the world's.
    turns = quat_mul(rig.tpose, quat_conj(rig.tpose[rig.pelvis]))
    ends = {role: j for role in _ENDS if (j := rig.roles.joint(role)) is not None}
    limbs = {j for group in LIMBS for j in limb_joints(rig.roles, group)} - {*ends.values()}
    if quat_angle(turns, quat_identity(turns))[[*limbs]].max(initial=0.0) > _T:
        return {}
    yaws = {role: float(yaw_from_quat(turns[j])) for role, j in ends.items()}
    built: dict[Role, float] = {}
    for pair in (ANKLES, HANDS):  # which were built alike: where one is bent, so is the other
        both = {role: yaws[role] for role in pair if role in yaws}
        if all(abs(yaw) < _BUILT for yaw in both.values()):
            built |= both
    return built
