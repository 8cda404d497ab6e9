"""How the ecosystems name a human's joints: what random rigs are named by and names learned from.

A convention gives a template a role. `{L}` `{l}` `{Left}` `{left}` `{LEFT}` `{左}` stand for the
side; `{i}` counts the joints of a chain from 0, `{n}` from 1, and `{m}` leaves the first without a
number (Spine, Spine1, ...).
"""

from collections.abc import Iterable

from spark.rig.roles import Role

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
robot      | pelvis | torso_link{m} | neck_link{m} | head_link | {left}_clavicle_link | {left}_shoulder_pitch_link | {left}_elbow_link | {left}_wrist_yaw_link | {left}_hip_pitch_link | {left}_knee_link | {left}_ankle_roll_link | {left}_toe_link
xsens      | Pelvis | T{n} | Neck{m} | Head | {Left}Shoulder | {Left}UpperArm | {Left}ForeArm | {Left}Hand | {Left}UpperLeg | {Left}LowerLeg | {Left}Foot | {Left}Toe
bandai     | Hips | Spine{m} | Neck{m} | Head | Shoulder_{L} | UpperArm_{L} | LowerArm_{L} | Hand_{L} | UpperLeg_{L} | LowerLeg_{L} | Foot_{L} | Toes_{L}
neuron     | Robot_Hips | Robot_Spine{m} | Robot_Neck{m} | Robot_Head | Robot_{Left}Shoulder | Robot_{Left}Arm | Robot_{Left}ForeArm | Robot_{Left}Hand | Robot_{Left}UpLeg | Robot_{Left}Leg | Robot_{Left}Foot | Robot_{Left}ToeBase
valve      | ValveBiped.Bip01_Pelvis | ValveBiped.Bip01_Spine{m} | ValveBiped.Bip01_Neck{n} | ValveBiped.Bip01_Head1 | ValveBiped.Bip01_{L}_Clavicle | ValveBiped.Bip01_{L}_UpperArm | ValveBiped.Bip01_{L}_Forearm | ValveBiped.Bip01_{L}_Hand | ValveBiped.Bip01_{L}_Thigh | ValveBiped.Bip01_{L}_Calf | ValveBiped.Bip01_{L}_Foot | ValveBiped.Bip01_{L}_Toe0
plain      | hips | spine{m} | neck{m} | head | shoulder_{left} | upper_arm_{left} | lower_arm_{left} | hand_{left} | upper_leg_{left} | lower_leg_{left} | foot_{left} | toes_{left}
rigify_spine | DEF-spine | DEF-spine.00{n} | DEF-neck{m} | DEF-head | DEF-shoulder.{L} | DEF-upper_arm.{L} | DEF-forearm.{L} | DEF-hand.{L} | DEF-thigh.{L} | DEF-shin.{L} | DEF-foot.{L} | DEF-toe.{L}
genesis9 | hip | spine{n} | neck{n} | head | {l}_shoulder | {l}_upperarm | {l}_forearm | {l}_hand | {l}_thigh | {l}_shin | {l}_foot | {l}_toes
poser | hip | abdomen{m} | neck{m} | head | {l}Collar | {l}Shldr | {l}ForeArm | {l}Hand | {l}Thigh | {l}Shin | {l}Foot | {l}Toe
optitrack | Hip | Chest{m} | Neck{m} | Head | {L}Shoulder | {L}UArm | {L}FArm | {L}Hand | {L}Thigh | {L}Shin | {L}Foot | {L}Toe
advanced | Root_M | Spine{n}_M | Neck{m}_M | Head_M | Scapula_{L} | Shoulder_{L} | Elbow_{L} | Wrist_{L} | Hip_{L} | Knee_{L} | Ankle_{L} | Toes_{L}
autorig | root.x | spine_0{n}.x | neck{m}.x | head.x | shoulder.{l} | arm_stretch.{l} | forearm_stretch.{l} | hand.{l} | thigh_stretch.{l} | leg_stretch.{l} | foot.{l} | toes_01.{l}
arkit | hips_joint | spine_{n}_joint | neck_{n}_joint | head_joint | {left}_shoulder_1_joint | {left}_arm_joint | {left}_forearm_joint | {left}_hand_joint | {left}_upLeg_joint | {left}_leg_joint | {left}_foot_joint | {left}_toes_joint
azure | PELVIS | SPINE_CHEST{m} | NECK{m} | HEAD | CLAVICLE_{LEFT} | SHOULDER_{LEFT} | ELBOW_{LEFT} | WRIST_{LEFT} | HIP_{LEFT} | KNEE_{LEFT} | ANKLE_{LEFT} | FOOT_{LEFT}
secondlife | mPelvis | mTorso{m} | mNeck{m} | mHead | mCollar{Left} | mShoulder{Left} | mElbow{Left} | mWrist{Left} | mHip{Left} | mKnee{Left} | mAnkle{Left} | mFoot{Left}
rokoko | Hips | Spine{n} | Neck{m} | Head | {Left}Shoulder | {Left}Arm | {Left}ForeArm | {Left}Hand | {Left}Thigh | {Left}Shin | {Left}Foot | {Left}Toe
rage | SKEL_Pelvis | SKEL_Spine{i} | SKEL_Neck_{n} | SKEL_Head | SKEL_{L}_Clavicle | SKEL_{L}_UpperArm | SKEL_{L}_Forearm | SKEL_{L}_Hand | SKEL_{L}_Thigh | SKEL_{L}_Calf | SKEL_{L}_Foot | SKEL_{L}_Toe0
creation | NPC Pelvis [Pelv] | NPC Spine{m} [Spn{i}] | NPC Neck{m} [Neck] | NPC Head [Head] | NPC {L} Clavicle [{L}Clv] | NPC {L} UpperArm [{L}Uar] | NPC {L} Forearm [{L}Lar] | NPC {L} Hand [{L}Hnd] | NPC {L} Thigh [{L}Thg] | NPC {L} Calf [{L}Clf] | NPC {L} Foot [{L}Ft] | NPC {L} Toe0 [{L}Toe]
sims | b__Pelvis__ | b__Spine{i}__ | b__Neck{m}__ | b__Head__ | b__{L}_Clavicle__ | b__{L}_UpperArm__ | b__{L}_ForeArm__ | b__{L}_Hand__ | b__{L}_Thigh__ | b__{L}_Calf__ | b__{L}_Foot__ | b__{L}_Toe__
blocks | LowerTorso | UpperTorso{m} | Neck{m} | Head | {Left}Collar | {Left}UpperArm | {Left}LowerArm | {Left}Hand | {Left}UpperLeg | {Left}LowerLeg | {Left}Foot | {Left}Toes
segments | pelvis | trunk{m} | neck{m} | skull | {left}_girdle | {left}_uparm | {left}_farm | {left}_hand | {left}_thigh | {left}_shank | {left}_foot | {left}_forefoot
opensim | pelvis | lumbar{n} | cervical{n} | head | clavicle_{l} | humerus_{l} | ulna_{l} | hand_{l} | femur_{l} | tibia_{l} | talus_{l} | toes_{l}
anatomy | Sacrum | Vertebra{n} | Cervical{n} | Skull | {Left}Scapula | {Left}Humerus | {Left}Ulna | {Left}Carpus | {Left}Femur | {Left}Fibula | {Left}Talus | {Left}Phalanges
hands | Hips | Waist{m} | Neck{m} | Head | ClavicleBone.{L} | BicepBone.{L} | ElbowBone.{L} | PalmBone.{L} | ThighBone.{L} | KneeBone.{L} | FootBone.{L} | ToeBone.{L}
hinges | base_link | waist_link{m} | neck_link{m} | head_link | {L}_clavicle | {L}_shoulder_roll | {L}_elbow_pitch | {L}_wrist_roll | {L}_hip_roll | {L}_knee_pitch | {L}_ankle_pitch | {L}_toe_pitch
flexions | base | trunk{m} | neck{m} | head | {l}_clavicle | {l}_shoulder_aa | {l}_elbow_fe | {l}_wrist_ie | {l}_hip_fe | {l}_knee_fe | {l}_ankle_fe | {l}_toe_fe
german | Becken | Wirbel{n} | Hals{m} | Kopf | Schluesselbein.{L} | Oberarm.{L} | Unterarm.{L} | Hand.{L} | Oberschenkel.{L} | Unterschenkel.{L} | Fuss.{L} | Zehen.{L}
spanish | Cadera | Columna{n} | Cuello{m} | Cabeza | Clavicula_{L} | Brazo_{L} | Antebrazo_{L} | Mano_{L} | Muslo_{L} | Pierna_{L} | Pie_{L} | Dedos_{L}
french | Bassin | Colonne{n} | Cou{m} | Tete | Clavicule_{L} | Bras_{L} | AvantBras_{L} | Main_{L} | Cuisse_{L} | Jambe_{L} | Pied_{L} | Orteils_{L}
mmd | 下半身 | 上半身{m} | 首{m} | 頭 | {左}肩 | {左}腕 | {左}ひじ | {左}手首 | {左}足 | {左}ひざ | {左}足首 | {左}つま先
romaji | koshi | sebone{m} | kubi{m} | atama | {l}_kata | {l}_ude | {l}_hiji | {l}_tekubi | {l}_ashi | {l}_hiza | {l}_ashikubi | {l}_tsumasaki
mmd_english | lower body | upper body{m} | neck{m} | head | shoulder_{L} | arm_{L} | elbow_{L} | wrist_{L} | leg_{L} | knee_{L} | ankle_{L} | toe_{L}
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
        side = role.side
        names.append(
            templates[role.part].format(
                i=count,
                n=count + 1,
                m=count or "",
                Left=side.capitalize(),
                left=side,
                LEFT=side.upper(),
                L=side[:1].upper(),
                l=side[:1],
                左={"left": "左", "right": "右"}.get(side, ""),
            )
        )
    return names
