"""The bones that VRM names, and what they are on a rig.

VRM Consortium, "VRMC_vrm-1.0", humanoid. VRM 0 has the same names but for the thumb's bones, which
are called as other fingers' are.
"""

from collections.abc import Mapping

from spark.errors import SkeletonError, name_list
from spark.rig.fingers import FINGER_NAMES, FingerBone
from spark.rig.override import Override
from spark.rig.rig import Rig
from spark.rig.roles import Role

_SPINE = ("spine", "chest", "upperChest")
_LIMBS = {
    "Shoulder": "clavicle",
    "UpperArm": "upper_arm",
    "LowerArm": "forearm",
    "Hand": "hand",
    "UpperLeg": "upper_leg",
    "LowerLeg": "lower_leg",
    "Foot": "foot",
    "Toes": "toe",
}
_ROLES = {"hips": Role.PELVIS, "neck": Role.NECK, "head": Role.HEAD} | {
    f"{side}{bone}": Role(f"{side}_{part}")
    for side in ("left", "right")
    for bone, part in _LIMBS.items()
}
_PHALANGES = ("Proximal", "Intermediate", "Distal")
_THUMB = ("Metacarpal", "Proximal", "Distal")
_PARTS = ("UpperArm", "LowerArm", "Hand", "UpperLeg", "LowerLeg", "Foot")
_SIDED = [f"{side}{part}" for part in _PARTS for side in ("left", "right")]
_REQUIRED = ("hips", "spine", "head", *_SIDED)


def roles_of_bones(bones: Mapping[str, int]) -> Override:
    """The roles of joints that a file calls these bones of VRM's."""
    roles: dict[Role, list[int]] = {
        role: [bones[name]] for name, role in _ROLES.items() if name in bones
    }
    if spine := [bones[name] for name in _SPINE if name in bones]:
        roles[Role.SPINE] = spine
    return roles


def bones_of_rig(rig: Rig) -> dict[str, int]:
    """The joint of a rig for each of VRM's bones that it has, parents first.

    Of more than three joints of the spine the first, the middle one and the last; of several of
    the neck the first. Raises `SkeletonError` where one is missing that VRM asks for.
    """
    found = {name: j for name, role in _ROLES.items() if (j := rig.roles.joint(role)) is not None}
    spine = rig.roles.joints(Role.SPINE)
    if len(spine) > len(_SPINE):
        spine = (spine[0], spine[len(spine) // 2], spine[-1])
    found |= dict(zip(_SPINE, spine, strict=False))
    for side in ("left", "right"):
        for finger in FINGER_NAMES:
            for number, bone in enumerate(_THUMB if finger == "thumb" else _PHALANGES, start=1):
                joint = rig.fingers.get(FingerBone(side, finger, number))
                if joint is not None:
                    found[f"{side}{finger.capitalize()}{bone}"] = joint
    if missing := [name for name in _REQUIRED if name not in found]:
        raise SkeletonError(f"a VRM animation needs {name_list(missing)}, which the body lacks")
    return dict(sorted(found.items(), key=lambda item: item[1]))
