"""How the ecosystems name a human's joints: what random rigs are named by and names learned from.

A convention gives a template a role. `{L}` `{l}` `{Left}` `{left}` stand for the side; `{i}`
counts the joints of a chain from 0, `{n}` from 1, and `{m}` leaves the first without a number
(Spine, Spine1, ...).
"""

from collections.abc import Iterable

from spark.roles import Role

_ORDER = [
    "pelvis",
    "spine",
    "neck",
    "head",
    "clavicle",
    "upper_arm",
    "forearm",
    "hand",
    "upper_leg",
    "lower_leg",
    "foot",
    "toe",
]

_TABLE = """
mixamo     | mixamorig:Hips | mixamorig:Spine{m} | mixamorig:Neck{m} | mixamorig:Head | mixamorig:{Left}Shoulder | mixamorig:{Left}Arm | mixamorig:{Left}ForeArm | mixamorig:{Left}Hand | mixamorig:{Left}UpLeg | mixamorig:{Left}Leg | mixamorig:{Left}Foot | mixamorig:{Left}ToeBase
motionbuilder | Hips | Spine{m} | Neck{m} | Head | {Left}Shoulder | {Left}Arm | {Left}ForeArm | {Left}Hand | {Left}UpLeg | {Left}Leg | {Left}Foot | {Left}ToeBase
asf        | root | back{n} | neck{n} | head | {l}clavicle | {l}humerus | {l}radius | {l}wrist | {l}femur | {l}tibia | {l}foot | {l}toes
max        | Hips | Chest{m} | Neck{m} | Head | {Left}Collar | {Left}Shoulder | {Left}Elbow | {Left}Wrist | {Left}Hip | {Left}Knee | {Left}Ankle | {Left}Toe
biped      | Bip01 Pelvis | Bip01 Spine{m} | Bip01 Neck{m} | Bip01 Head | Bip01 {L} Clavicle | Bip01 {L} UpperArm | Bip01 {L} Forearm | Bip01 {L} Hand | Bip01 {L} Thigh | Bip01 {L} Calf | Bip01 {L} Foot | Bip01 {L} Toe0
unreal     | pelvis | spine_0{n} | neck_0{n} | head | clavicle_{l} | upperarm_{l} | lowerarm_{l} | hand_{l} | thigh_{l} | calf_{l} | foot_{l} | ball_{l}
rigify     | DEF-hips | DEF-spine.00{n} | DEF-neck.00{n} | DEF-head | DEF-shoulder.{L} | DEF-upper_arm.{L} | DEF-forearm.{L} | DEF-hand.{L} | DEF-thigh.{L} | DEF-shin.{L} | DEF-foot.{L} | DEF-toe.{L}
vrm        | J_Bip_C_Hips | J_Bip_C_Spine{m} | J_Bip_C_Neck{m} | J_Bip_C_Head | J_Bip_{L}_Shoulder | J_Bip_{L}_UpperArm | J_Bip_{L}_LowerArm | J_Bip_{L}_Hand | J_Bip_{L}_UpperLeg | J_Bip_{L}_LowerLeg | J_Bip_{L}_Foot | J_Bip_{L}_ToeBase
smpl       | Pelvis | Spine{n} | Neck{m} | Head | {L}_Collar | {L}_Shoulder | {L}_Elbow | {L}_Wrist | {L}_Hip | {L}_Knee | {L}_Ankle | {L}_Foot
daz        | hip | abdomen{m} | neck{m} | head | {l}Collar | {l}ShldrBend | {l}ForearmBend | {l}Hand | {l}ThighBend | {l}Shin | {l}Foot | {l}Toe
iclone     | CC_Base_Hip | CC_Base_Spine0{n} | CC_Base_NeckTwist0{n} | CC_Base_Head | CC_Base_{L}_Clavicle | CC_Base_{L}_Upperarm | CC_Base_{L}_Forearm | CC_Base_{L}_Hand | CC_Base_{L}_Thigh | CC_Base_{L}_Calf | CC_Base_{L}_Foot | CC_Base_{L}_ToeBase
makehuman  | Hips | Spine{n} | Neck{m} | Head | Clavicle_{L} | UpArm_{L} | LoArm_{L} | Hand_{L} | UpLeg_{L} | LoLeg_{L} | Foot_{L} | Toe_{L}
robot      | pelvis | torso_link{m} | neck_link{m} | head_link | {left}_shoulder_pitch_link | {left}_shoulder_yaw_link | {left}_elbow_link | {left}_wrist_yaw_link | {left}_hip_pitch_link | {left}_knee_link | {left}_ankle_roll_link | {left}_toe_link
xsens      | Pelvis | T{n} | Neck{m} | Head | {Left}Shoulder | {Left}UpperArm | {Left}ForeArm | {Left}Hand | {Left}UpperLeg | {Left}LowerLeg | {Left}Foot | {Left}Toe
bandai     | Hips | Spine{m} | Neck{m} | Head | Shoulder_{L} | UpperArm_{L} | LowerArm_{L} | Hand_{L} | UpperLeg_{L} | LowerLeg_{L} | Foot_{L} | Toes_{L}
neuron     | Robot_Hips | Robot_Spine{m} | Robot_Neck{m} | Robot_Head | Robot_{Left}Shoulder | Robot_{Left}Arm | Robot_{Left}ForeArm | Robot_{Left}Hand | Robot_{Left}UpLeg | Robot_{Left}Leg | Robot_{Left}Foot | Robot_{Left}ToeBase
valve      | ValveBiped.Bip01_Pelvis | ValveBiped.Bip01_Spine{m} | ValveBiped.Bip01_Neck{n} | ValveBiped.Bip01_Head1 | ValveBiped.Bip01_{L}_Clavicle | ValveBiped.Bip01_{L}_UpperArm | ValveBiped.Bip01_{L}_Forearm | ValveBiped.Bip01_{L}_Hand | ValveBiped.Bip01_{L}_Thigh | ValveBiped.Bip01_{L}_Calf | ValveBiped.Bip01_{L}_Foot | ValveBiped.Bip01_{L}_Toe0
plain      | hips | spine{m} | neck{m} | head | shoulder_{left} | upper_arm_{left} | lower_arm_{left} | hand_{left} | upper_leg_{left} | lower_leg_{left} | foot_{left} | toes_{left}
"""  # noqa: E501

CONVENTIONS: dict[str, dict[str, str]] = {
    cells[0]: dict(zip(_ORDER, cells[1:], strict=True))
    for line in _TABLE.strip().splitlines()
    if (cells := [cell.strip() for cell in line.split("|")])
}

HELD_OUT = ("unreal", "xsens", "valve", "plain")
"""Conventions that the name encoder is never trained on: what its accuracy is measured with."""


def name_joints(roles: Iterable[Role | None], convention: str) -> list[str]:
    """A name for each joint in order; a joint without a role is named after the one before it."""
    templates = CONVENTIONS[convention]
    counts: dict[Role, int] = {}
    names: list[str] = []
    for role in roles:
        if role is None:
            names.append(f"{names[-1] if names else 'joint'}_sub")
            continue
        count = counts.get(role, 0)
        counts[role] = count + 1
        side, kind = split_side(role)
        names.append(
            templates[kind].format(
                i=count,
                n=count + 1,
                m=count or "",
                Left=side.capitalize(),
                left=side,
                L=side[:1].upper(),
                l=side[:1],
            )
        )
    return names


def split_side(role: Role) -> tuple[str, str]:
    """`left_foot` to ("left", "foot"); ("", "head") for what has no side."""
    side, _, kind = role.value.partition("_")
    return (side, kind) if side in ("left", "right") else ("", role.value)
