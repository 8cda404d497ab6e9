"""Humanoid rigs as the ecosystem names them, built on one body in T-pose.

A rig is written as chains, one a line: `Hips P > Spine S > Neck N > Head H`. A chain may begin at a
joint that an earlier line made. The letter after a name is the joint's role (`CODES`), `-` is none.
A line with `{Left}`, `{left}`, `{L}`, `{l}` or `{左}` stands for one on each side.
"""

import numpy as np

from spark.motion import Motion
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec
from spark.skeleton import Skeleton

CODES = {
    "P": "pelvis",
    "S": "spine",
    "N": "neck",
    "H": "head",
    "C": "clavicle",
    "U": "upper_arm",
    "F": "forearm",
    "W": "hand",
    "T": "upper_leg",
    "K": "lower_leg",
    "A": "foot",
    "B": "toe",
}
# Places in the T-pose [m], left side; the right one is mirrored.
PLACES = {
    "P": (0.0, 0.0, 0.95),
    "H": (0.02, 0.0, 1.60),
    "C": (0.01, 0.03, 1.45),
    "U": (0.0, 0.18, 1.45),
    "F": (-0.01, 0.46, 1.45),
    "W": (0.0, 0.71, 1.45),
    "T": (0.0, 0.10, 0.90),
    "K": (0.01, 0.10, 0.49),
    "A": (-0.01, 0.10, 0.08),
    "B": (0.12, 0.10, 0.02),
}
SPINE = ((0.0, 0.0, 0.95), (0.0, 0.0, 1.38))
NECK = ((0.0, 0.0, 1.43), (0.02, 0.0, 1.60))
OUTWARDS = {  # from a joint to a tip below it
    "H": (0.0, 0.0, 0.18),
    "W": (0.02, 0.10, 0.0),
    "F": (0.02, 0.25, 0.0),
    "A": (0.18, 0.0, -0.07),
    "B": (0.07, 0.0, 0.0),
}

RIGS = {
    "mixamo": """
        mixamorig:Hips P > mixamorig:Spine S > mixamorig:Spine1 S > mixamorig:Spine2 S
        mixamorig:Spine2 > mixamorig:Neck N > mixamorig:Head H > mixamorig:HeadTop_End -
        mixamorig:Head > mixamorig:LeftEye -
        mixamorig:Head > mixamorig:RightEye -
        mixamorig:Spine2 > mixamorig:{Left}Shoulder C > mixamorig:{Left}Arm U
        mixamorig:{Left}Arm > mixamorig:{Left}ForeArm F > mixamorig:{Left}Hand W
        mixamorig:{Left}Hand > mixamorig:{Left}HandThumb1 - > mixamorig:{Left}HandThumb2 -
        mixamorig:{Left}Hand > mixamorig:{Left}HandIndex1 - > mixamorig:{Left}HandIndex2 -
        mixamorig:Hips > mixamorig:{Left}UpLeg T > mixamorig:{Left}Leg K > mixamorig:{Left}Foot A
        mixamorig:{Left}Foot > mixamorig:{Left}ToeBase B > mixamorig:{Left}Toe_End -
        """,
    "lafan1": """
        Hips P > {Left}UpLeg T > {Left}Leg K > {Left}Foot A > {Left}Toe B
        Hips > Spine S > Spine1 S > Spine2 S > Neck N > Head H
        Spine2 > {Left}Shoulder C > {Left}Arm U > {Left}ForeArm F > {Left}Hand W
        """,
    "unreal": """
        root - > pelvis P > spine_01 S > spine_02 S > spine_03 S > neck_01 N > head H
        spine_03 > clavicle_{l} C > upperarm_{l} U > lowerarm_{l} F > hand_{l} W > index_01_{l} -
        hand_{l} > thumb_01_{l} -
        upperarm_{l} > upperarm_twist_01_{l} -
        lowerarm_{l} > lowerarm_twist_01_{l} -
        pelvis > thigh_{l} T > calf_{l} K > foot_{l} A > ball_{l} B
        calf_{l} > calf_twist_01_{l} -
        thigh_{l} > thigh_twist_01_{l} -
        root > ik_foot_root - > ik_foot_{l} -
        root > ik_hand_root - > ik_hand_gun - > ik_hand_{l} -
        """,
    "vrm": """
        Root - > J_Bip_C_Hips P > J_Bip_C_Spine S > J_Bip_C_Chest S > J_Bip_C_UpperChest S
        J_Bip_C_UpperChest > J_Bip_C_Neck N > J_Bip_C_Head H > J_Adj_{L}_FaceEye -
        J_Bip_C_Head > J_Sec_Hair1_01 - > J_Sec_Hair2_01 -
        J_Bip_C_UpperChest > J_Sec_{L}_Bust1 -
        J_Bip_C_UpperChest > J_Bip_{L}_Shoulder C > J_Bip_{L}_UpperArm U > J_Bip_{L}_LowerArm F
        J_Bip_{L}_LowerArm > J_Bip_{L}_Hand W > J_Bip_{L}_Index1 -
        J_Bip_C_Hips > J_Bip_{L}_UpperLeg T > J_Bip_{L}_LowerLeg K > J_Bip_{L}_Foot A
        J_Bip_{L}_Foot > J_Bip_{L}_ToeBase B
        J_Bip_C_Hips > J_Sec_{L}_SkirtFront0_01 - > J_Sec_{L}_SkirtFront1_01 -
        """,
    "rigify": """
        DEF-spine P > DEF-pelvis.{L} -
        DEF-spine > DEF-spine.001 S > DEF-spine.002 S > DEF-spine.003 S
        DEF-spine.003 > DEF-neck N > DEF-head H
        DEF-spine.003 > DEF-shoulder.{L} C > DEF-upper_arm.{L} U > DEF-upper_arm.{L}.001 -
        DEF-upper_arm.{L}.001 > DEF-forearm.{L} F > DEF-forearm.{L}.001 - > DEF-hand.{L} W
        DEF-hand.{L} > DEF-f_index.01.{L} -
        DEF-hand.{L} > DEF-thumb.01.{L} -
        DEF-spine.003 > DEF-breast.{L} -
        DEF-spine > DEF-thigh.{L} T > DEF-thigh.{L}.001 - > DEF-shin.{L} K > DEF-shin.{L}.001 -
        DEF-shin.{L}.001 > DEF-foot.{L} A > DEF-toe.{L} B
        """,
    "rigify controls": """
        root - > MCH-torso.parent - > torso -
        root > ORG-spine P > ORG-spine.001 S > ORG-spine.002 S > ORG-neck N > ORG-head H
        ORG-spine.002 > ORG-shoulder.{L} C > ORG-upper_arm.{L} U > ORG-forearm.{L} F
        ORG-forearm.{L} > ORG-hand.{L} W
        ORG-spine > ORG-thigh.{L} T > ORG-shin.{L} K > ORG-foot.{L} A > ORG-toe.{L} B
        root > foot_ik.{L} - > MCH-foot_roll.{L} -
        root > hand_ik.{L} -
        """,
    "biped": """
        Bip01 - > Bip01 Pelvis P > Bip01 Spine S > Bip01 Spine1 S > Bip01 Neck N > Bip01 Head H
        Bip01 Head > Bip01 HeadNub -
        Bip01 > Bip01 Footsteps -
        Bip01 Neck > Bip01 {L} Clavicle C > Bip01 {L} UpperArm U > Bip01 {L} Forearm F
        Bip01 {L} Forearm > Bip01 {L} Hand W > Bip01 {L} Finger0 - > Bip01 {L} Finger0Nub -
        Bip01 Pelvis > Bip01 {L} Thigh T > Bip01 {L} Calf K > Bip01 {L} Foot A > Bip01 {L} Toe0 B
        Bip01 {L} Toe0 > Bip01 {L} Toe0Nub -
        """,
    "biped, legs on the spine": """
        Bip001 - > Bip001 Pelvis P > Bip001 Spine S > Bip001 Spine1 S > Bip001 Spine2 S
        Bip001 Spine2 > Bip001 Neck N > Bip001 Head H > Bip001 Ponytail1 -
        Bip001 Neck > Bip001 {L} Clavicle C > Bip001 {L} UpperArm U > Bip001 {L} Forearm F
        Bip001 {L} Forearm > Bip001 {L} Hand W > Bip001 {L} Finger0 -
        Bip001 Spine > Bip001 {L} Thigh T > Bip001 {L} Calf K > Bip001 {L} Foot A
        Bip001 {L} Foot > Bip001 {L} Toe0 B
        """,
    "perception neuron": """
        Robot_Hips P > Robot_{Left}UpLeg T > Robot_{Left}Leg K > Robot_{Left}Foot A
        Robot_Hips > Robot_Spine S > Robot_Spine1 S > Robot_Spine2 S > Robot_Spine3 S
        Robot_Spine3 > Robot_Neck N > Robot_Head H
        Robot_Spine3 > Robot_{Left}Shoulder C > Robot_{Left}Arm U > Robot_{Left}ForeArm F
        Robot_{Left}ForeArm > Robot_{Left}Hand W > Robot_{Left}InHandIndex -
        Robot_{Left}InHandIndex > Robot_{Left}HandIndex1 -
        Robot_{Left}Hand > Robot_{Left}HandThumb1 -
        """,
    "xsens": """
        Pelvis P > L5 S > L3 S > T12 S > T8 S > Neck N > Head H
        T8 > {Left}Shoulder C > {Left}UpperArm U > {Left}ForeArm F > {Left}Hand W
        Pelvis > {Left}UpperLeg T > {Left}LowerLeg K > {Left}Foot A > {Left}Toe B
        """,
    "xsens bvh": """
        Hips P > Chest S > Chest2 S > Chest3 S > Chest4 S > Neck N > Head H
        Chest4 > {Left}Collar C > {Left}Shoulder U > {Left}Elbow F > {Left}Wrist W
        Hips > {Left}Hip T > {Left}Knee K > {Left}Ankle A > {Left}Toe B
        """,
    "optitrack": """
        Hip P > Ab S > Chest S > Neck N > Head H
        Chest > {L}Shoulder C > {L}UArm U > {L}FArm F > {L}Hand W
        Hip > {L}Thigh T > {L}Shin K > {L}Foot A > {L}Toe B
        """,
    "vicon": """
        root P > lowerback S > upperback S > thorax S > lowerneck N > upperneck N > head H
        thorax > {l}clavicle C > {l}humerus U > {l}radius F > {l}wrist W > {l}hand - > {l}fingers -
        {l}hand > {l}thumb -
        root > {l}hipjoint - > {l}femur T > {l}tibia K > {l}foot A > {l}toes B
        """,
    "smpl": """
        Pelvis P > {L}_Hip T > {L}_Knee K > {L}_Ankle A > {L}_Foot B
        Pelvis > Spine1 S > Spine2 S > Spine3 S > Neck N > Head H
        Spine3 > {L}_Collar C > {L}_Shoulder U > {L}_Elbow F > {L}_Wrist W > {L}_Hand -
        """,
    "smplx": """
        pelvis P > {left}_hip T > {left}_knee K > {left}_ankle A > {left}_foot B
        pelvis > spine1 S > spine2 S > spine3 S > neck N > head H > jaw -
        head > {left}_eye_smplhf -
        spine3 > {left}_collar C > {left}_shoulder U > {left}_elbow F > {left}_wrist W
        {left}_wrist > {left}_index1 -
        {left}_wrist > {left}_thumb1 -
        """,
    "daz genesis 3": """
        hip - > pelvis P > {l}ThighBend T > {l}ThighTwist - > {l}Shin K > {l}Foot A
        {l}Foot > {l}Metatarsals - > {l}Toe B > {l}BigToe -
        {l}Foot > {l}Heel -
        hip > abdomenLower S > abdomenUpper S > chestLower S > chestUpper S
        chestUpper > neckLower N > neckUpper N > head H > upperJaw -
        head > {l}Eye -
        head > {l}Ear -
        chestLower > {l}Pectoral -
        chestUpper > {l}Collar C > {l}ShldrBend U > {l}ShldrTwist - > {l}ForearmBend F
        {l}ForearmBend > {l}ForearmTwist - > {l}Hand W > {l}Carpal1 - > {l}Index1 -
        """,
    "iclone": """
        CC_Base_BoneRoot - > CC_Base_Hip - > CC_Base_Pelvis P
        CC_Base_Pelvis > CC_Base_{L}_Thigh T > CC_Base_{L}_Calf K > CC_Base_{L}_Foot A
        CC_Base_{L}_Foot > CC_Base_{L}_ToeBase B > CC_Base_{L}_BigToe1 -
        CC_Base_{L}_Thigh > CC_Base_{L}_ThighTwist01 - > CC_Base_{L}_ThighTwist02 -
        CC_Base_{L}_Calf > CC_Base_{L}_KneeShareBone -
        CC_Base_Hip > CC_Base_Waist S > CC_Base_Spine01 S > CC_Base_Spine02 S
        CC_Base_Spine02 > CC_Base_NeckTwist01 N > CC_Base_NeckTwist02 N > CC_Base_Head H
        CC_Base_Head > CC_Base_FacialBone - > CC_Base_JawRoot -
        CC_Base_Spine02 > CC_Base_{L}_RibsTwist - > CC_Base_{L}_Breast -
        CC_Base_Spine02 > CC_Base_{L}_Clavicle C > CC_Base_{L}_Upperarm U > CC_Base_{L}_Forearm F
        CC_Base_{L}_Forearm > CC_Base_{L}_Hand W > CC_Base_{L}_Index1 -
        CC_Base_{L}_Forearm > CC_Base_{L}_ForearmTwist01 - > CC_Base_{L}_ForearmTwist02 -
        CC_Base_{L}_Upperarm > CC_Base_{L}_UpperarmTwist01 -
        """,
    "humanik": """
        Character1_Reference - > Character1_Hips P > Character1_Spine S > Character1_Spine1 S
        Character1_Spine1 > Character1_Neck N > Character1_Head H
        Character1_Spine1 > Character1_{Left}Shoulder C > Character1_{Left}Arm U
        Character1_{Left}Arm > Character1_{Left}ArmRoll - > Character1_{Left}ForeArm F
        Character1_{Left}ForeArm > Character1_{Left}ForeArmRoll - > Character1_{Left}Hand W
        Character1_Hips > Character1_{Left}UpLeg T > Character1_{Left}UpLegRoll -
        Character1_{Left}UpLegRoll > Character1_{Left}Leg K > Character1_{Left}LegRoll -
        Character1_{Left}LegRoll > Character1_{Left}Foot A > Character1_{Left}ToeBase B
        """,
    "bandai namco": """
        joint_Root - > Hips P > Spine S > Chest S > Neck N > Head H
        Chest > Shoulder_{L} C > UpperArm_{L} U > LowerArm_{L} F > Hand_{L} W
        Hips > UpperLeg_{L} T > LowerLeg_{L} K > Foot_{L} A > Toes_{L} B
        """,
    "source engine": """
        ValveBiped.Bip01_Pelvis P > ValveBiped.Bip01_{L}_Thigh T > ValveBiped.Bip01_{L}_Calf K
        ValveBiped.Bip01_{L}_Calf > ValveBiped.Bip01_{L}_Foot A > ValveBiped.Bip01_{L}_Toe0 B
        ValveBiped.Bip01_Pelvis > ValveBiped.Bip01_Spine S > ValveBiped.Bip01_Spine1 S
        ValveBiped.Bip01_Spine1 > ValveBiped.Bip01_Spine2 S > ValveBiped.Bip01_Spine4 S
        ValveBiped.Bip01_Spine4 > ValveBiped.Bip01_Neck1 N > ValveBiped.Bip01_Head1 H
        ValveBiped.Bip01_Head1 > ValveBiped.forward -
        ValveBiped.Bip01_Spine4 > ValveBiped.Bip01_{L}_Clavicle C > ValveBiped.Bip01_{L}_UpperArm U
        ValveBiped.Bip01_{L}_UpperArm > ValveBiped.Bip01_{L}_Forearm F
        ValveBiped.Bip01_{L}_Forearm > ValveBiped.Bip01_{L}_Hand W > ValveBiped.Bip01_{L}_Finger0 -
        ValveBiped.Bip01_{L}_Hand > ValveBiped.Anim_Attachment_{L}H -
        """,
    "mikumikudance": """
        全ての親 - > センター - > 下半身 P > {左}足 T > {左}ひざ K > {左}足首 A > {左}つま先 B
        センター > 上半身 S > 上半身2 S > 首 N > 頭 H > {左}目 -
        上半身2 > {左}肩 C > {左}腕 U > {左}腕捩 - > {左}ひじ F > {左}手捩 -
        {左}手捩 > {左}手首 W > {左}親指１ -
        全ての親 > {左}足ＩＫ - > {左}つま先ＩＫ -
        下半身 > スカート_0_0 - > スカート_0_1 -
        """,
    "robot": """
        pelvis P > {left}_hip_pitch_link T > {left}_knee_link K > {left}_ankle_pitch_link A
        pelvis > torso_link S > head_link H
        torso_link > {left}_shoulder_pitch_link U > {left}_elbow_link F > {left}_wrist_yaw_link W
        """,
    "atlas": """
        pelvis P > back_bkz S > head H
        back_bkz > {l}_arm_shz U > {l}_arm_elx F > {l}_arm_wrx W
        pelvis > {l}_leg_hpz T > {l}_leg_kny K > {l}_leg_aky A
        """,
    "atlas's bodies": """
        pelvis P > utorso S > head H
        utorso > {l}_scap C > {l}_uarm U > {l}_larm F > {l}_hand W
        pelvis > {l}_uleg T > {l}_lleg K > {l}_foot A
        """,
    "robot without arms": """
        base - > torso_link P > {L}_HAA T > {L}_KFE K > {L}_AFE A
        """,
    "unreal 5": """
        root - > pelvis P > spine_01 S > spine_02 S > spine_03 S > spine_04 S > spine_05 S
        spine_05 > neck_01 N > neck_02 N > head H
        spine_05 > clavicle_{l} C > upperarm_{l} U > lowerarm_{l} F > hand_{l} W
        hand_{l} > index_metacarpal_{l} - > index_01_{l} -
        hand_{l} > wrist_inner_{l} -
        clavicle_{l} > clavicle_pec_{l} -
        upperarm_{l} > upperarm_correctiveRoot_{l} - > upperarm_bck_{l} -
        upperarm_{l} > upperarm_twist_01_{l} - > upperarm_bicep_{l} -
        lowerarm_{l} > lowerarm_correctiveRoot_{l} - > lowerarm_out_{l} -
        pelvis > thigh_{l} T > calf_{l} K > foot_{l} A > ball_{l} B > bigtoe_01_{l} -
        foot_{l} > ankle_bck_{l} -
        calf_{l} > calf_correctiveRoot_{l} - > calf_kneeBack_{l} -
        root > ik_foot_root - > ik_foot_{l} -
        root > center_of_mass -
        """,
    "synty": """
        Root - > Hips P > Spine_01 S > Spine_02 S > Spine_03 S > Neck N > Head H > Eyebrows -
        Spine_03 > Clavicle_{L} C > Shoulder_{L} U > Elbow_{L} F > Hand_{L} W > Thumb_01_{L} -
        Hand_{L} > IndexFinger_01_{L} -
        Hips > UpperLeg_{L} T > LowerLeg_{L} K > Ankle_{L} A > Ball_{L} B > Toes_{L} -
        """,
    "roblox": """
        HumanoidRootPart - > LowerTorso P > UpperTorso S > Head H
        UpperTorso > {Left}UpperArm U > {Left}LowerArm F > {Left}Hand W
        LowerTorso > {Left}UpperLeg T > {Left}LowerLeg K > {Left}Foot A
        """,
    "poser": """
        hip P > abdomen S > chest S > neck N > head H > {left}Eye -
        chest > {l}Collar C > {l}Shldr U > {l}ForeArm F > {l}Hand W > {l}Thumb1 -
        hip > {l}Buttock - > {l}Thigh T > {l}Shin K > {l}Foot A
        """,
    "advanced skeleton": """
        Root_M P > Spine1_M S > Chest_M S > Neck_M N > Head_M H > HeadEnd_M -
        Chest_M > Scapula_{L} C > Shoulder_{L} U > ShoulderPart1_{L} - > Elbow_{L} F
        Elbow_{L} > Wrist_{L} W > MiddleFinger1_{L} -
        Root_M > Hip_{L} T > HipPart1_{L} - > Knee_{L} K > Ankle_{L} A > Toes_{L} B > ToesEnd_{L} -
        Ankle_{L} > Heel_{L} -
        """,
    "auto-rig pro": """
        root.x P > spine_01.x S > spine_02.x S > spine_03.x S > neck.x N > head.x H > jawbone.x -
        spine_03.x > shoulder.{l} C > arm_stretch.{l} U > forearm_stretch.{l} F > hand.{l} W
        arm_stretch.{l} > arm_twist.{l} -
        spine_03.x > breast_01.{l} -
        root.x > thigh_stretch.{l} T > leg_stretch.{l} K > foot.{l} A > toes_01.{l} B
        thigh_stretch.{l} > thigh_twist.{l} -
        leg_stretch.{l} > leg_twist.{l} -
        """,
    "headset": """
        Root - > Hips P > SpineLower S > SpineMiddle S > SpineUpper S > Chest S > Neck N > Head H
        Chest > {Left}Scapula C > {Left}ArmUpper U > {Left}ArmLower F > {Left}HandWrist W
        {Left}HandWrist > {Left}HandPalm -
        {Left}HandWrist > {Left}HandIndexMetacarpal -
        Hips > {Left}UpperLeg T > {Left}LowerLeg K > {Left}FootAnkle A > {Left}FootBall B
        """,
    "capitals": """
        HIPS P > SPINE S > CHEST S > NECK N > HEAD H
        CHEST > {LEFT}_SHOULDER U > {LEFT}_ELBOW F > {LEFT}_WRIST W
        HIPS > {LEFT}_HIP T > {LEFT}_KNEE K > {LEFT}_ANKLE A > {LEFT}_TOE B
        """,
    "plain words": """
        body - > hip P > waist S > torso S > neck N > head H
        torso > {left} shoulder C > {left} upper arm U > {left} lower arm F > {left} hand W
        hip > {left} upper leg T > {left} lower leg K > {left} foot A
        """,
    "side last": """
        pelvis_jnt P > spine1_jnt S > spine2_jnt S > neck_jnt N > head_jnt H
        spine2_jnt > clav{L}_jnt C > arm{L}_jnt U > elbow{L}_jnt F > hand{L}_jnt W
        pelvis_jnt > leg{L}_jnt T > knee{L}_jnt K > ankle{L}_jnt A > ball{L}_jnt B
        """,
}

_SIDES = {
    "{Left}": ("Left", "Right"),
    "{left}": ("left", "right"),
    "{LEFT}": ("LEFT", "RIGHT"),
    "{L}": ("L", "R"),
    "{l}": ("l", "r"),
    "{左}": ("左", "右"),
}
_Rows = list[tuple[str, int, str, int]]  # name, parent, code, side: +1 left, -1 right, 0 neither


def build(
    chains: str, *, ends: bool = True, names: str | None = None
) -> tuple[Skeleton, tuple[Role | None, ...]]:
    """The skeleton in T-pose facing +X, and the role of each joint.

    `ends` gives leaves End Sites. `names` renames the joints, with their number in it.
    """
    rows = _rows(chains)
    places = _places(rows)
    parents = np.array([parent for _, parent, _, _ in rows])
    offsets = places.copy()
    offsets[1:] -= places[parents[1:]]
    leaves = [j for j in range(len(rows)) if j not in parents] if ends else []
    skeleton = Skeleton(
        names=tuple(
            name if names is None else names.format(j) for j, (name, _, _, _) in enumerate(rows)
        ),
        parents=parents,
        offsets=offsets,
        translating=np.arange(len(rows)) == 0,
        end_parents=np.array(leaves, dtype=np.int64),
        end_offsets=np.array([_outwards(*rows[j][2:]) for j in leaves]).reshape(-1, 3),
    )
    return skeleton, tuple(_role(code, side) for _, _, code, side in rows)


def _role(code: str, side: int) -> Role | None:
    if code == "-":
        return None
    return Role(f"{'left_' if side > 0 else 'right_'}{CODES[code]}" if side else CODES[code])


def _rows(chains: str) -> _Rows:
    rows: _Rows = []
    for line in filter(None, map(str.strip, chains.splitlines())):
        sided = any(mark in line for mark in _SIDES)
        for index, side in enumerate((1, -1) if sided else (0,)):
            text = line
            for mark, words in _SIDES.items():
                text = text.replace(mark, words[index])
            parent = -1
            for place, item in enumerate(text.split(" > ")):
                known = [j for j, row in enumerate(rows) if row[0] == item]
                if place == 0 and known:
                    parent = known[0]
                    continue
                name, code = item.rsplit(" ", 1)
                if name in [row[0] for row in rows]:  # a joint of the midline in a sided line
                    parent = [row[0] for row in rows].index(name)
                    continue
                rows.append((name, parent, code, side if code not in "PSNH" else 0))
                parent = len(rows) - 1
    return rows


def _places(rows: _Rows) -> np.ndarray:
    places = np.full((len(rows), 3), np.nan)
    for code, (low, high) in (("S", SPINE), ("N", NECK)):
        joints = [j for j, row in enumerate(rows) if row[2] == code]
        for i, j in enumerate(joints):
            part = (i + 1) / len(joints) if code == "S" else i / len(joints)
            places[j] = np.add(low, part * np.subtract(high, low))
    for j, (_, _, code, side) in enumerate(rows):
        if code in PLACES:
            places[j] = np.multiply(PLACES[code], (1, side or 1, 1))
    for j, (_, parent, _, side) in enumerate(rows):
        if not np.isnan(places[j, 0]):
            continue
        steps, below = 1, [k for k, row in enumerate(rows) if row[1] == j]
        while below and not any(rows[k][2] != "-" for k in below):
            steps, below = steps + 1, [k for k, row in enumerate(rows) if row[1] in below]
        if below:
            goal = places[next(k for k in below if rows[k][2] != "-")]
            start = places[parent] if parent >= 0 else goal
            places[j] = start + (goal - start) / (steps + 1)
        elif parent >= 0:
            places[j] = places[parent] + 0.4 * np.array(_outwards(rows[parent][2], side))
    return places


def _outwards(code: str, side: int) -> tuple[float, float, float]:
    x, y, z = OUTWARDS.get(code, (0.03, 0.02, 0.02))
    return x, y * side, z


def walk(
    skeleton: Skeleton, roles: tuple[Role | None, ...], frames: int = 40, turn: float = 0.0
) -> Motion:
    """The body walks, arms down and elbows bent; `turn` [rad] is its heading from +X."""
    phase = np.linspace(0, 4 * np.pi, frames)
    rotvec = np.zeros((frames, len(skeleton), 3))
    for j, role in enumerate(roles):
        if role is None or not role.side:
            continue
        side, part = role.side, role.part
        sign = 1.0 if side == "left" else -1.0
        swing = np.sin(phase) * sign
        if part == "upper_leg":
            rotvec[:, j, 1] = -0.5 * swing
        elif part == "lower_leg":
            rotvec[:, j, 1] = 0.5 + 0.4 * np.cos(phase + sign)
        elif part == "upper_arm":
            rotvec[:, j, 0] = -1.2 * sign
        elif part == "forearm":
            rotvec[:, j, 2] = -sign * (0.5 + 0.2 * swing)
    rotvec[:, 0, 2] = turn
    root = np.tile(skeleton.offsets[0], (frames, 1))
    return Motion(skeleton, 1 / 30, root, quat_from_rotvec(rotvec))
