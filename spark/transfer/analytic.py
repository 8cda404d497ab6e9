"""Analytic transfer: a motion in canonical form onto another rig, without learning.

Joints of the same role turn alike, hands as the joint that their fingers turn with. Where spine or
neck have other joints, or the same number in other places, rotations are interpolated by normalised
arc length, with the pelvis at 0 and the topmost spine joint at 1 (for the neck: topmost spine joint
and head). Joints without a role copy those of the same name in the same place; doubles turn with
their originals; fingers as the same bone of the same finger, whatever its name; all others follow
their parent (twist bones until `spark.transfer.twists` turns them). This is the row "copy" of every
table.
"""

from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from spark.blocks import in_blocks
from spark.rig.rig import Rig
from spark.rig.roles import CLAVICLES, Role
from spark.rotation import quat_conj, quat_slerp
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.finger_pairs import finger_notes, finger_pairs
from spark.transfer.rest_ends import from_rest_to_rest

# Normalised arc length along a chain, 0 to 1. Joints of two chains of equal length are taken one by
# one where none lies further than this from its counterpart.
_MAX_OFFSET = 0.3
# A joint further than this from all of the source's joints of its chain is unmatched: a little more
# than the step between the joints of a spine of four.
_MAX_GAP = 0.26

# [hip heights] A floor further than this from z = 0 is moved to 0.
FLOOR_TOLERANCE = 0.1


@dataclass(frozen=True, eq=False)
class Correspondence:
    """Target joint j turns `mix[j]` of the way from source joint `first[j]` to `second[j]`.

    -1 in `first` marks joints above the target's root joint: they stay as they rest.
    `unmatched[j]` is j for a joint of spine, neck or shoulders without a counterpart in the source;
    for a joint without a role that follows one of these, the one that it follows; else -1.
    """

    first: Int[np.ndarray, "J"]
    second: Int[np.ndarray, "J"]
    mix: Float[np.ndarray, "J"]
    unmatched: Int[np.ndarray, "J"]

    def rotations(
        self, source: Float[np.ndarray, "*n S 4"], target: Rig
    ) -> Float[np.ndarray, "*n J 4"]:
        """The target's rotations since the T-pose from the source's."""
        out = source[..., self.first, :]
        between = np.flatnonzero(self.mix)
        if len(between):
            out[..., between, :] = quat_slerp(
                out[..., between, :],
                source[..., self.second[between], :],
                np.broadcast_to(self.mix[between], (*source.shape[:-2], len(between))),
            )
        above = np.flatnonzero(self.first < 0)
        out[..., above, :] = quat_conj(target.tpose[above])
        return out


def correspond(source: Rig, target: Rig) -> Correspondence:
    """Which joints of `source` each joint of `target` takes its rotation from."""
    size = len(target.skeleton)
    first, mix = np.full(size, -1), np.zeros(size)
    second, unmatched = first.copy(), first.copy()
    known = np.zeros(size, dtype=bool)

    def copy(j: int, from_joint: int) -> None:
        first[j] = second[j] = from_joint
        known[j] = True

    for role in Role:
        if role not in target.chains:
            theirs, own = source.roles.joints(role), target.roles.joints(role)
            for from_joint, j in zip(theirs, own, strict=False):
                copy(j, from_joint)
                if j in target.palms:
                    copy(target.palms[j], source.palms[from_joint])
    for role, (joints, at) in source.chains.items():
        theirs, own = source.roles.joints(role), target.roles.joints(role)
        positions = dict(zip(*target.chains[role], strict=True))
        offsets = (
            abs(at[joints.index(a)] - positions[j]) for a, j in zip(theirs, own, strict=False)
        )
        if len(theirs) == len(own) and max(offsets, default=0.0) < _MAX_OFFSET:
            for from_joint, j in zip(theirs, own, strict=True):
                copy(j, from_joint)
        for j in own:
            if known[j]:
                continue
            k = bisect_right(at, positions[j]) - 1
            after = min(k + 1, len(at) - 1)
            span = at[after] - at[k]
            first[j], second[j] = joints[k], joints[after]
            mix[j] = (positions[j] - at[k]) / span if span > 0 else 0.0
            known[j] = True
            alone = all(abs(at[joints.index(a)] - positions[j]) > _MAX_GAP for a in theirs)
            unmatched[j] = j if alone and len(joints) > 1 else -1

    names = {name: j for j, name in enumerate(source.skeleton.names)}
    fingers = finger_pairs(source, target)
    above = target.skeleton.ancestors(target.pelvis)[1:]
    for j in range(size):
        if known[j]:
            continue
        same = names.get(target.skeleton.names[j])
        if same is not None and source.roles.roles[same] is not None:
            same = None
        if j in above:
            if j >= target.root_joint:
                above_pelvis = same in source.skeleton.ancestors(source.pelvis)[1:]
                copy(j, same if same is not None and above_pelvis else source.pelvis)
            continue
        parent = int(target.skeleton.parents[j])
        if same is not None and not mix[parent] and _hangs(source, same, int(first[parent])):
            copy(j, same)
        elif j in fingers:
            copy(j, fingers[j])
        else:
            with_it = target.doubles.get(j, parent)
            first[j], second[j], mix[j] = first[with_it], second[with_it], mix[with_it]
            unmatched[j] = j if target.roles.roles[j] in CLAVICLES else unmatched[with_it]
    return Correspondence(first, second, mix, unmatched)


def transfer(source: CanonicalMotion, target: Rig) -> CanonicalMotion:
    """`source`'s motion on a character, in canonical form: `copied`, hands and feet from rest pose
    to rest pose (`spark.transfer.rest_ends`)."""
    return from_rest_to_rest(source.rig, copied(source, target))


def copied(source: CanonicalMotion, target: Rig) -> CanonicalMotion:
    """`source`'s motion on `target`, whose joints turn since the T-pose as the source's do.

    The hips' path is scaled by the hip heights' ratio about the floor. The floor is z = 0, unless
    the source's feet say that it is elsewhere: then it is moved to 0 and a note says so.
    """
    link = correspond(source.rig, target)
    rotations = in_blocks(
        lambda block: link.rotations(source.rotations[block], target), len(source)
    )
    scale = target.hip_height / source.rig.hip_height
    notes = (*source.notes, *_without_arms(source.rig, target), *finger_notes(source, target))
    lift = 0.0
    if abs(source.floor_z) > FLOOR_TOLERANCE * source.rig.hip_height:
        lift = source.floor_z
        notes += (f"floor at z = {source.floor_z:.2f} m; moved to 0",)
    hips = (source.hips - np.array([0, 0, lift])) * scale
    floor_z = (source.floor_z - lift) * scale
    return CanonicalMotion(target, source.frame_time, rotations, hips, floor_z, notes)


def _without_arms(source: Rig, target: Rig) -> tuple[str, ...]:
    """What is left out or stays still where one of the two bodies has legs only."""
    theirs, own = (
        bool(rig.roles.joints(Role.LEFT_UPPER_ARM) or rig.roles.joints(Role.RIGHT_UPPER_ARM))
        for rig in (source, target)
    )
    if theirs and not own:
        return ("the target has no arms: what the source's do is left out",)
    if own and not theirs:
        return ("the source has no arms: the target's stay out to the sides, as in the T-pose",)
    return ()


def _hangs(rig: Rig, joint: int, ancestor: int) -> bool:
    """Whether `joint` hangs below `ancestor` over joints without a role."""
    while (joint := int(rig.skeleton.parents[joint])) >= 0:
        if joint == ancestor:
            return True
        if rig.roles.roles[joint] is not None:
            return False
    return False
