"""Analytic transfer: a motion in canonical form onto another rig, without learning.

Joints of the same role turn alike. Spine and neck may have other numbers of joints: their rotations
are interpolated by normalised arc length, with the pelvis at 0 and the topmost spine joint (for the
neck: the head) at 1. Whatever else the target has follows its parent. This is the row "copy" of
every table.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from spark.canonical import CanonicalMotion
from spark.rig import Rig
from spark.roles import LIMBS, Role
from spark.rotation import quat_conj, quat_slerp

# A floor further than this from z = 0, in hip heights, is moved to 0.
_FLOOR_TOLERANCE = 0.1


@dataclass(frozen=True, eq=False)
class Correspondence:
    """Target joint j turns `mix[j]` of the way from source joint `first[j]` to `second[j]`.

    -1 in `first` marks joints above the target's carrier: they stay as they rest.
    """

    first: Int[np.ndarray, "J"]
    second: Int[np.ndarray, "J"]
    mix: Float[np.ndarray, "J"]

    def rotations(
        self, source: Float[np.ndarray, "*n S 4"], target: Rig
    ) -> Float[np.ndarray, "*n J 4"]:
        """The target's rotations since the T-pose from the source's."""
        turned = source[..., self.first, :]
        between = np.flatnonzero(self.mix)
        if len(between):
            turned[..., between, :] = quat_slerp(
                turned[..., between, :],
                source[..., self.second[between], :],
                np.broadcast_to(self.mix[between], (*source.shape[:-2], len(between))),
            )
        held = np.flatnonzero(self.first < 0)
        turned[..., held, :] = quat_conj(target.tpose[held])
        return turned


def correspond(source: Rig, target: Rig) -> Correspondence:
    """Which joints of `source` each joint of `target` takes its rotation from."""
    size = len(target.skeleton)
    first, mix = np.full(size, -1), np.zeros(size)
    second = first.copy()
    known = np.zeros(size, dtype=bool)

    def copy(j: int, from_joint: int) -> None:
        first[j] = second[j] = from_joint
        known[j] = True

    copy(target.pelvis, source.pelvis)
    for limb in LIMBS.values():
        for role in limb:
            theirs, own = source.roles.joint(role), target.roles.joint(role)
            if theirs is not None and own is not None:
                copy(own, theirs)
    for role, start, end in (
        (Role.SPINE, Role.PELVIS, None),
        (Role.NECK, Role.SPINE, Role.HEAD),
    ):
        theirs_chain, at = _chain(source, role, start, end)
        own_chain, want = _chain(target, role, start, end)
        for j, u in zip(own_chain[1:], want[1:].tolist(), strict=True):
            k = min(int(np.searchsorted(at, u, side="right")) - 1, len(at) - 1)
            after = min(k + 1, len(at) - 1)
            span = at[after] - at[k]
            first[j], second[j] = theirs_chain[k], theirs_chain[after]
            mix[j] = (u - at[k]) / span if span > 0 else 0.0
            known[j] = True

    names = {name: j for j, name in enumerate(source.skeleton.names)}
    between = target.skeleton.ancestors(target.pelvis)[1:]
    for j in range(size):
        parent = int(target.skeleton.parents[j])
        if known[j]:
            continue
        if j in between:
            if j >= target.carrier:
                copy(j, source.pelvis)
            continue
        same = names.get(target.skeleton.names[j])
        if same is not None and source.roles.roles[same] is None:
            above = int(source.skeleton.parents[same])
            if not mix[parent] and _rigid_with(source, above, int(first[parent])):
                copy(j, same)
                continue
        first[j], second[j], mix[j] = first[parent], second[parent], mix[parent]
    return Correspondence(first, second, mix)


def transfer(source: CanonicalMotion, target: Rig) -> CanonicalMotion:
    """`source`'s motion on `target`, in canonical form.

    The hips' path is scaled by the hip heights' ratio about the floor. The floor is z = 0, unless
    the source's feet say that it is elsewhere: then it is moved to 0 and a note says so.
    """
    rotations = correspond(source.rig, target).rotations(source.rotations, target)
    scale = target.hip_height / source.rig.hip_height
    notes = source.notes
    lift = 0.0
    if abs(source.floor_z) > _FLOOR_TOLERANCE * source.rig.hip_height:
        lift = source.floor_z
        notes += (f"floor at z = {source.floor_z:.2f} m; moved to 0",)
    hips = (source.hips - np.array([0, 0, lift])) * scale
    floor_z = (source.floor_z - lift) * scale
    return CanonicalMotion(target, source.frame_time, rotations, hips, floor_z, notes)


def _chain(
    rig: Rig, role: Role, start: Role, end: Role | None
) -> tuple[list[int], Float[np.ndarray, "_"]]:
    """The joints from the last one of `start` over those of `role` to `end`, and their normalised
    arc lengths. A chain of one joint lies at 0."""
    begin = rig.roles.joints(start)[-1:] or (rig.pelvis,)
    tail = rig.roles.joints(end)[:1] if end is not None else ()
    joints = [*begin, *rig.roles.joints(role), *tail]
    steps = np.linalg.norm(np.diff(rig.skeleton.rest_positions[joints], axis=0), axis=1)
    arc = np.concatenate([[0.0], np.cumsum(steps)])
    if arc[-1] > 0:
        arc /= arc[-1]
    arc[-1] = 1.0 if len(joints) > 1 else 0.0
    return joints, arc


def _rigid_with(rig: Rig, joint: int, ancestor: int) -> bool:
    """Whether `joint` is `ancestor` or hangs below it over joints without a role."""
    while joint >= 0:
        if joint == ancestor:
            return True
        if rig.roles.roles[joint] is not None:
            return False
        joint = int(rig.skeleton.parents[joint])
    return False
