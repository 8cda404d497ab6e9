"""Which finger of one rig bends as which of another.

Hands have five fingers, four, three as cartoons do, or one for all. A finger that the source lacks
bends as the nearest one that it has: straight beside bent ones it would seem to point.
"""

import numpy as np

from spark.errors import name_list
from spark.rig.fingers import ALL_FINGERS, FINGER_NAMES, FingerBone
from spark.rig.rig import Rig
from spark.rig.roles import Role
from spark.rotation import quat_angle
from spark.transfer.canonical import CanonicalMotion

_MIN_BEND = np.radians(5)  # a finger that bends less against its palm is at rest
_THUMB, *_LONG = FINGER_NAMES
_MIDDLE = 1.2  # fingers from the index: of two that are as near, the one nearer to here is taken


def finger_pairs(source: Rig, target: Rig) -> dict[int, int]:
    """The source's joint for each joint of the target's fingers that has one: of the same bone, and
    of the same finger or the nearest to it; the thumb, and bones in the palm, only of the same."""
    theirs, out = source.fingers, {}
    for bone, j in target.fingers.items():
        candidates = _nearest_first(bone.finger) if bone.number else [bone.finger]
        first_bones = (bone._replace(finger=finger, number=1) for finger in candidates)
        finger = next((b.finger for b in first_bones if b in theirs), bone.finger)
        from_joint = theirs.get(bone._replace(finger=finger))
        if from_joint is not None:
            out[j] = from_joint
    return out


def _nearest_first(finger: str) -> list[str]:
    if finger == _THUMB:
        return [finger]
    at = _LONG.index(finger) if finger in _LONG else _MIDDLE
    places = {each: k for k, each in enumerate(_LONG)}
    near = sorted(_LONG, key=lambda each: (abs(places[each] - at), abs(places[each] - _MIDDLE)))
    return [finger, *near, ALL_FINGERS]


def finger_notes(source: CanonicalMotion, target: Rig) -> tuple[str, ...]:
    """Which fingers of the source are left out, where they bend, and which of the target the source
    lacks."""
    theirs = {bone: j for bone, j in source.rig.fingers.items() if bone.number}
    own = {bone: j for bone, j in target.fingers.items() if bone.number}
    pairs = finger_pairs(source.rig, target)
    used = set(pairs.values())
    lost = {bone: j for bone, j in theirs.items() if bone not in own and j not in used}
    notes: tuple[str, ...] = ()
    palms = [_palm(source.rig, bone) for bone in lost]
    bends = quat_angle(source.rotations[:, palms], source.rotations[:, list(lost.values())])
    bent = [j for j, bend in zip(lost.values(), bends.T, strict=True) if bend.max() > _MIN_BEND]
    if bent:
        notes += (
            f"{name_list([source.rig.skeleton.names[j] for j in bent])}: left out, fingers that "
            f"the target lacks (they bend by up to {np.degrees(bends.max()):.0f} degrees)",
        )
    missing = {bone: j for bone, j in own.items() if bone not in theirs}
    for joints, what in (
        ([j for j in missing.values() if j in pairs], "they bend as those beside them"),
        ([j for j in missing.values() if j not in pairs], "they follow their hands"),
    ):
        if joints:
            names = name_list([target.skeleton.names[j] for j in joints])
            notes += (f"{names}: fingers that the source lacks, {what}",)
    return notes


def _palm(rig: Rig, bone: FingerBone) -> int:
    return rig.palms[rig.roles.require(Role(f"{bone.side}_hand"))]
