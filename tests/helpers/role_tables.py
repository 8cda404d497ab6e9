"""Which joint holds which role on each recorded rig: tables written by looking at the rigs."""

from dataclasses import replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np

from spark.motion import Motion
from spark.rig.roles import Role, RoleMap
from spark.skeleton import Skeleton
from tests.helpers.recordings import recordings

Roles = tuple[Role | None, ...]

# Which joint holds which role: hierarchy and positions of each rig, looked at by hand. {L}, {l}
# and {Left} are the sides; a role that is not there is held by nobody.
CMU_MOTIONBUILDER = """
    pelvis=Hips spine=LowerBack,Spine,Spine1 neck=Neck,Neck1 head=Head
    clavicle={Left}Shoulder upper_arm={Left}Arm forearm={Left}ForeArm hand={Left}Hand
    upper_leg={Left}UpLeg lower_leg={Left}Leg foot={Left}Foot toe={Left}ToeBase
    """

CMU_MAX = """
    pelvis=Hips spine=lowerback,Chest,Chest2 neck=lowerneck,Neck head=Head
    clavicle={Left}Collar upper_arm={Left}Shoulder forearm={Left}Elbow hand={Left}Wrist
    upper_leg={Left}Hip lower_leg={Left}Knee foot={Left}Ankle toe={Left}Toe
    """

CMU_ASF = """
    pelvis=root spine=lowerback,upperback,thorax neck=lowerneck,upperneck head=head
    clavicle={l}clavicle upper_arm={l}humerus forearm={l}radius hand={l}wrist
    upper_leg={l}femur lower_leg={l}tibia foot={l}foot toe={l}toes
    """

MOTIONBUILDER_3 = """
    pelvis=Hips spine=Spine,Spine1,Spine2 neck=Neck head=Head
    clavicle={Left}Shoulder upper_arm={Left}Arm forearm={Left}ForeArm hand={Left}Hand
    upper_leg={Left}UpLeg lower_leg={Left}Leg foot={Left}Foot toe={Left}ToeBase
    """

MOTIONBUILDER_4 = MOTIONBUILDER_3.replace("Spine2", "Spine2,Spine3")

REACTIDLE = """
    pelvis=pelvis spine=spine,spine.001 neck=neck head=face
    clavicle=shoulder.{L} upper_arm=upper_arm.{L} forearm=forearm.{L}
    upper_leg=thigh.{L} lower_leg=shin.{L} foot=foot.{L}
    """

MESH2MOTION = """
    pelvis=DEF-hips spine=DEF-spine.001,DEF-spine.002,DEF-spine.003 neck=DEF-neck head=DEF-head
    clavicle=DEF-shoulder.{L} upper_arm=DEF-upper_arm.{L} forearm=DEF-forearm.{L}
    hand=DEF-hand.{L} upper_leg=DEF-thigh.{L} lower_leg=DEF-shin.{L} foot=DEF-foot.{L}
    toe=DEF-toe.{L}
    """

MAKEHUMAN_75 = """
    pelvis=Hips spine=Spine1,Spine2,Spine3 neck=Neck head=Head
    clavicle=Clavicle_{L} upper_arm=UpArm_{L} forearm=LoArm_{L} hand=Hand_{L}
    upper_leg=UpLeg_{L} lower_leg=LoLeg_{L} foot=Foot_{L} toe=Toe_{L}
    """

MAKEHUMAN_163 = """
    pelvis=root spine=spine05,spine04,spine03,spine02,spine01 neck=neck01,neck02,neck03 head=head
    clavicle=clavicle.{L} upper_arm=upperarm01.{L} forearm=lowerarm01.{L} hand=wrist.{L}
    upper_leg=upperleg01.{L} lower_leg=lowerleg01.{L} foot=foot.{L} toe=toe1-1.{L}
    """

# A biped dinosaur that stands on its toes: the heel's joint (Ankle) is a segment more.
KAIJU = """
    pelvis=Hips spine=Spine_1,Spine_2,Spine_2.001 neck=Spine_3,Spine_4 head=Head
    clavicle=Front_Leg_Shoulder_{L} upper_arm=Front_Leg_Upper_{L} forearm=Front_Leg_Lower_{L}
    hand=Hand_{L} upper_leg=Back_Leg_Upper_{L} lower_leg=Back_Leg_Lower_{L}
    foot=Back_Leg_Foot_{L} toe=Back_Leg_Foot_1_{L}
    """

# Wings for arms: of five segments the first two are the upper arm and the third is the forearm.
BIRD = """
    pelvis=hips spine=spine_0,spine_1 neck=spine_2,spine_3 head=head
    upper_arm=wing_1_{L} forearm=wing_3_{L} hand=wing_4_{L}
    upper_leg=UpperLeg_{L} lower_leg=LowerLeg_{L} foot=Foot_{L} toe=Toes_{L}
    """

TABLE = {
    "zoo/cmu_cgspeed_31j.bvh": CMU_MOTIONBUILDER,
    "cmu_expmap/*.bvh": CMU_MOTIONBUILDER,
    "zoo/cmu_max_131.bvh": CMU_MAX,
    "zoo/cmu_scaled_metre.bvh": CMU_MAX,
    "zoo/ad_cmu1.bvh": CMU_MAX,
    "animateddrawings/jumping_jacks.bvh": CMU_MAX,
    "zoo/cmu_asf_cm.bvh": CMU_ASF,
    "cmu_asf/*.bvh": CMU_ASF,
    "zoo/ad_rokoko_mixamo.bvh": MOTIONBUILDER_3,
    "animateddrawings/jesse_dance.bvh": MOTIONBUILDER_3,
    "zoo/ad_fair1_zup.bvh": MOTIONBUILDER_4,
    "animateddrawings/[dwz]*.bvh": MOTIONBUILDER_4,
    "animateddrawings/jumping.bvh": MOTIONBUILDER_4,
    "zoo/reactidle_blender.bvh": REACTIDLE,
    "reactidle/*.bvh": REACTIDLE,
    "zoo/m2m_human.bvh": MESH2MOTION,
    "mesh2motion/human*.bvh": MESH2MOTION,
    "zoo/makehuman_walk.bvh": MAKEHUMAN_75,
    "zoo/makehuman_zombie.bvh": MAKEHUMAN_75,
    "makehuman/*1.bvh": MAKEHUMAN_75,
    "zoo/makehuman_face.bvh": MAKEHUMAN_163,
    "zoo/makehuman_tpose_163.bvh": MAKEHUMAN_163,
    "makehuman/[bft]*.bvh": MAKEHUMAN_163,
    "zoo/m2m_kaiju.bvh": KAIJU,
    "mesh2motion/kaiju*.bvh": KAIJU,
    "zoo/m2m_bird.bvh": BIRD,
    "mesh2motion/bird*.bvh": BIRD,
}

REFUSED = {
    "fox": "walks on four legs, its front limbs reach the ground",
    "horse": "walks on four legs, its front limbs reach the ground",
    "spider": "has 8 legs",
    "snake": "one chain of joints",
    "shark": "fins and no legs",
    "dragon": "pairs of limbs, one of them wings",
}

# One recording of each rig; the others of a set share its skeleton. All takes of the sets that
# animals and odd rigs come from are read: a body must not change its plan when it falls.
RECORDINGS = ("zoo/*.bvh", "makehuman/*.bvh", "animateddrawings/*.bvh", "mesh2motion/*.bvh")

SAMPLES = (*RECORDINGS, "cmu_asf/*_03.bvh", "cmu_expmap/*_1.bvh", "reactidle/*.bvh")


def table(text: str) -> dict[str, str]:
    """Joint name to role."""
    found: dict[str, str] = {}
    for entry in text.split():
        role, names = entry.split("=")
        for name in names.split(","):
            if "{" not in name:
                found[name] = role
                continue
            for side in ("left", "right"):
                words = {"Left": side.capitalize(), "L": side[0].upper(), "l": side[0]}
                found[name.format(**words)] = f"{side}_{role}"
    return found


def expected(path: Path) -> str | None:
    """The table that a recording's rig is in."""
    place = f"{path.parent.name}/{path.name}"
    return next((text for pattern, text in TABLE.items() if fnmatch(place, pattern)), None)


def known_recordings(*patterns: str) -> list[Any]:
    """The recordings that are in the table; those that are not are tested to be refused."""
    parameters: list[Any] = recordings(*patterns)
    return [p for p in parameters if p.marks or expected(p.values[0])]


def as_strings(skeleton: Skeleton, roles: RoleMap) -> dict[str, str]:
    return {n: str(r) for n, r in zip(skeleton.names, roles.roles, strict=True) if r is not None}


def wrong(skeleton: Skeleton, roles: RoleMap, right: Roles) -> dict[str, tuple[str, str]]:
    """Joints that hold another role than they should: what is right, what was said."""
    rows = zip(skeleton.names, right, roles.roles, strict=True)
    return {name: (str(a), str(b)) for name, a, b in rows if a is not b}


def mirrored(motion: Motion) -> Motion:
    """The motion in a mirror, the names as they are."""
    flip = np.array([1.0, -1.0, 1.0])
    skeleton = replace(
        motion.skeleton,
        offsets=motion.skeleton.offsets * flip,
        end_offsets=motion.skeleton.end_offsets * flip,
    )
    return replace(
        motion,
        skeleton=skeleton,
        root_pos=motion.root_pos * flip,
        rotations=motion.rotations * np.array([1.0, -1.0, 1.0, -1.0]),
    )
