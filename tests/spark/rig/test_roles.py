"""Roles, groups and overrides: tables written by looking at the rigs."""

from dataclasses import replace
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spark.errors import SkeletonError
from spark.io.recording import read_recording
from spark.motion import Motion
from spark.rig.groups import groups_of
from spark.rig.override import check_chains
from spark.rig.role_assignment import assign_roles
from spark.rig.roles import LIMBS, Group, Role, RoleMap
from spark.rotation import quat_from_rotvec, quat_mul
from spark.skeleton import Skeleton
from tests.helpers.recordings import recordings
from tests.helpers.rigs import RIGS, build, walk

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


@pytest.mark.parametrize("path", known_recordings(*SAMPLES))
def test_roles_of_recordings_are_those_of_the_table(path: Path) -> None:
    text = expected(path)
    assert text is not None
    motion = read_recording(path).motion
    roles = assign_roles(motion.skeleton, motion)
    assert as_strings(motion.skeleton, roles) == table(text)
    assert all(c >= 0.8 for c, r in zip(roles.confidence, roles.roles, strict=True) if r)
    assert all(roles.reasons)


@pytest.mark.parametrize("path", recordings("zoo/*.bvh", "mesh2motion/*.bvh"))
def test_other_bodies_are_refused_with_the_reason(path: Path) -> None:
    motion = read_recording(path).motion
    animal = next((a for a in REFUSED if a in path.stem), None)
    if animal is None and len(motion.skeleton) > 6:
        assert expected(path) is not None, "a recording that neither table knows"
        return
    reason = "too few" if animal is None else REFUSED[animal]
    with pytest.raises(SkeletonError, match=reason) as caught:
        assign_roles(motion.skeleton, motion)
    assert "map file" in str(caught.value)


@pytest.mark.parametrize(
    "path",
    recordings(
        "zoo/cmu_*.bvh", "zoo/ad_*.bvh", "zoo/reactidle*.bvh", "zoo/m2m_human.bvh",
        "cmu_expmap/test_*_1.bvh", "reactidle/*.bvh",
    ),
)  # fmt: skip
def test_roles_without_names_are_the_same(path: Path) -> None:
    motion = read_recording(path).motion
    names = tuple(f"joint_{j}" for j in range(len(motion.skeleton)))
    motion = replace(motion, skeleton=replace(motion.skeleton, names=names))
    text = expected(path)
    assert text is not None
    if text is CMU_ASF:  # the twist of its forearm is a joint: only the name tells it from a wrist
        text = text.replace("{l}wrist", "{l}hand")
    originals = read_recording(path).motion.skeleton.names
    roles = assign_roles(motion.skeleton, motion)
    found = dict(zip(originals, roles.roles, strict=True))
    assert {n: str(r) for n, r in found.items() if r is not None} == table(text)
    assert all(c <= 0.9 for c in roles.confidence), "without names nothing is sure"


@pytest.mark.parametrize("ends", [True, False], ids=["ends", "no-ends"])
@pytest.mark.parametrize("convention", RIGS)
def test_roles_of_the_ecosystems_rigs(convention: str, ends: bool) -> None:
    skeleton, right = build(RIGS[convention], ends=ends)
    motion = walk(skeleton, right, turn=1.0)
    assert wrong(skeleton, assign_roles(skeleton), right) == {}
    assert wrong(skeleton, assign_roles(skeleton, motion), right) == {}
    roles = assign_roles(skeleton, motion)
    assert min(c for c, r in zip(roles.confidence, right, strict=True) if r) > 0.8


PREFIXES = {"mixamorig:": "mixamorig1:", "mixamorig:L": "mixamorig_L", "mixamorig:Hips": "Hips"}


@pytest.mark.parametrize("prefix", ["mixamorig1:", "mixamorig_", "", "Bob_", "Scene|rig:", "bob."])
def test_prefixes_say_nothing(prefix: str) -> None:
    skeleton, right = build(RIGS["mixamo"])
    names = tuple(name.replace("mixamorig:", prefix) for name in skeleton.names)
    skeleton = replace(skeleton, names=names)
    assert wrong(skeleton, assign_roles(skeleton), right) == {}


# Without names these are open: arms that hang on the neck, legs on the spine...
OPEN_WITHOUT_NAMES = ("biped", "biped, legs on the spine")
# ... and the head, where one joint (a jaw, eyebrows) follows it as it follows the neck.
OPEN_HEADS = ("iclone", "source engine", "synty", "advanced skeleton", "auto-rig pro")


@pytest.mark.parametrize("pose", ["walks", "lies on its back", "lies on its face", "on its side"])
@pytest.mark.parametrize("convention", [c for c in RIGS if c not in OPEN_WITHOUT_NAMES])
def test_meaningless_names(convention: str, pose: str) -> None:
    skeleton, right = build(RIGS[convention], names="joint_{}")
    motion = walk(skeleton, right, turn=2.0)
    tilt = {"walks": (0, 0, 0), "lies on its back": (0, -1.6, 0), "on its side": (1.6, 0, 0)}
    turn = quat_from_rotvec(np.array(tilt.get(pose, (0, 1.6, 0)), dtype=np.float64))
    rotations = motion.rotations.copy()
    rotations[:, 0] = quat_mul(turn, rotations[:, 0])
    motion = replace(motion, rotations=rotations)
    found = wrong(skeleton, assign_roles(skeleton, motion), right)
    if convention in OPEN_HEADS:
        found = {n: pair for n, pair in found.items() if not {"neck", "head"} & {*pair}}
    assert found == {}


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


def test_sides_come_from_the_front_where_names_say_nothing() -> None:
    skeleton, right = build(RIGS["lafan1"], names="joint_{}")
    motion = mirrored(walk(skeleton, right))
    swapped = tuple(role and role.mirrored for role in right)
    assert wrong(motion.skeleton, assign_roles(motion.skeleton, motion), swapped) == {}


@pytest.mark.parametrize("part", ["Leg|Foot|Toe", "Arm|Hand|Shoulder"])
def test_sides_that_names_give_to_one_pair_hold_for_the_other(part: str) -> None:
    skeleton, right = build(RIGS["lafan1"])
    names = tuple(
        name if any(word in name for word in part.split("|")) else f"joint_{j}"
        for j, name in enumerate(skeleton.names)
    )
    named = replace(skeleton, names=names)
    assert wrong(named, assign_roles(named, walk(named, right)), right) == {}
    motion = mirrored(walk(named, right))
    assert wrong(motion.skeleton, assign_roles(motion.skeleton, motion), right) == {}


def test_a_name_on_the_other_side_of_the_body_is_doubted() -> None:
    skeleton, right = build(RIGS["lafan1"])
    motion = mirrored(walk(skeleton, right))
    roles = assign_roles(motion.skeleton, motion)
    assert wrong(motion.skeleton, roles, right) == {}
    knee = skeleton.names.index("LeftLeg")
    assert "other side" in roles.reasons[knee]
    assert roles.confidence[knee] < 0.7 < assign_roles(skeleton).confidence[knee]


def test_a_side_that_nothing_shows_is_a_guess_and_says_so() -> None:
    """Straight knees and elbows, no feet: a body that is its own mirror image."""
    skeleton, _ = build(
        """
        a P > b S > c N > d H
        b > u{L} U > v{L} F > w{L} W
        a > t{L} T > k{L} K > f{L} A
        """,
        ends=False,
        names="joint_{}",
    )
    offsets = skeleton.offsets * np.array([0.0, 1.0, 1.0])
    roles = assign_roles(replace(skeleton, offsets=offsets))
    legs = roles.joints(Role.LEFT_UPPER_LEG) + roles.joints(Role.RIGHT_LOWER_LEG)
    assert len(legs) == 2
    assert all(roles.confidence[j] <= 0.5 for j in legs)
    assert all("guess" in roles.reasons[j] for j in legs)


def test_a_rest_pose_on_one_line_is_no_hindrance() -> None:
    """LAFAN1 and Rokoko: every bone along its joint's x axis, the pose in the rotations."""
    skeleton, right = build(RIGS["xsens"], names="joint_{}")
    motion = walk(skeleton, right)
    own = np.zeros((len(skeleton), 4))  # q_old_new of each joint's axes
    own[:, 0] = 1.0
    for j in range(len(skeleton)):
        tips = [*skeleton.offsets[list(skeleton.children[j])]]
        tips += [*skeleton.end_offsets[skeleton.end_parents == j]]
        if len(tips) == 1:
            axis = np.cross([1.0, 0.0, 0.0], tips[0])
            angle = np.arctan2(np.linalg.norm(axis), tips[0][0])
            unit = axis / max(np.linalg.norm(axis), 1e-12)
            own[j] = quat_from_rotvec(angle * (unit if unit.any() else np.array([0.0, 0, 1])))
    above = own[skeleton.parents]
    above[0] = (1.0, 0.0, 0.0, 0.0)
    back = np.array([1.0, -1, -1, -1])

    def turned(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        pure = np.concatenate([np.zeros((*v.shape[:-1], 1)), v], axis=-1)
        return quat_mul(quat_mul(q * back, pure), q)[..., 1:]

    line = replace(
        skeleton,
        offsets=turned(above, skeleton.offsets),
        end_offsets=turned(own[skeleton.end_parents], skeleton.end_offsets),
    )
    shin = skeleton.names.index("joint_17")
    assert abs(line.offsets[shin]) @ [0, 1, 1] < 1e-9 < line.offsets[shin, 0]
    rotations = quat_mul(quat_mul(above * back, motion.rotations), own)
    motion = replace(motion, skeleton=line, rotations=rotations)
    assert wrong(line, assign_roles(line, motion), right) == {}


@pytest.mark.parametrize("convention", ["mixamo", "smpl", "unreal"])
def test_the_order_of_joints_in_the_file_changes_nothing(convention: str) -> None:
    skeleton, right = build(RIGS[convention])
    rng = np.random.default_rng(5)
    order: list[int] = []
    open_ = [0]
    while open_:
        order.append(open_.pop(int(rng.integers(len(open_)))))
        open_ += skeleton.children[order[-1]]
    place = {old: new for new, old in enumerate(order)}
    shuffled = Skeleton(
        names=tuple(skeleton.names[j] for j in order),
        parents=np.array([place.get(int(skeleton.parents[j]), -1) for j in order]),
        offsets=skeleton.offsets[order],
        translating=skeleton.translating[order],
        end_parents=np.array([place[j] for j in skeleton.end_parents.tolist()]),
        end_offsets=skeleton.end_offsets,
    )
    assert order != sorted(order)
    assert wrong(shuffled, assign_roles(shuffled), tuple(right[j] for j in order)) == {}


@pytest.mark.parametrize("drop", ["Foot", "Hand", "Shoulder", "Neck", "Toe", "Spine"])
def test_missing_joints_leave_the_others_in_place(drop: str) -> None:
    chains = [
        " > ".join(item for item in line.split(" > ") if drop not in item)
        for line in RIGS["lafan1"].replace("Spine2 >", "Chest >").splitlines()
    ]
    text = "\n".join(chains).replace("Spine2 S", "Chest S")
    text = text.replace("Hips > Spine S > Spine1 S", "Hips > Spine S > Spine1 S")
    if drop == "Spine":
        text = text.replace("Hips > Neck", "Hips > Chest S > Neck")
    if drop == "Foot":
        text = text.replace(" > {Left}Toe B", "")
    skeleton, right = build(text)
    assert wrong(skeleton, assign_roles(skeleton), right) == {}


def test_arms_without_legs_are_refused() -> None:
    skeleton, _ = build(
        """
        Spine S > Spine1 S > Neck N > Head H
        Spine1 > {Left}Shoulder C > {Left}Arm U > {Left}ForeArm F > {Left}Hand W
        """
    )
    with pytest.raises(SkeletonError, match="arms but no pair of legs"):
        assign_roles(skeleton)


def test_bones_without_length_are_refused() -> None:
    skeleton, _ = build(RIGS["lafan1"], ends=False)
    with pytest.raises(SkeletonError, match="0 m long"):
        assign_roles(replace(skeleton, offsets=0 * skeleton.offsets))


def test_reasons_say_where_a_role_comes_from() -> None:
    skeleton, _ = build(RIGS["unreal"])
    roles = assign_roles(skeleton)
    reason = dict(zip(skeleton.names, roles.reasons, strict=True))
    assert reason["thigh_l"] == "name 'thigh_l'"
    assert reason["thumb_01_l"] == "a finger, by its name"
    assert reason["calf_twist_01_l"] == "a twist bone, by its name"
    assert reason["ik_foot_l"] == "a helper, by its name"


# Groups


def test_groups_share_the_hips_and_the_chest() -> None:
    skeleton, _ = build(RIGS["vicon"])
    groups = groups_of(skeleton, assign_roles(skeleton))
    of = dict(zip(skeleton.names, groups, strict=True))
    arms = {Group.LEFT_ARM, Group.RIGHT_ARM}
    assert of["root"] == {Group.TORSO, Group.LEFT_LEG, Group.RIGHT_LEG}
    assert of["thorax"] == {Group.TORSO, Group.HEAD} | arms
    assert of["lowerback"] == of["upperback"] == {Group.TORSO}
    assert of["lowerneck"] == of["head"] == {Group.HEAD}
    assert of["lhipjoint"] == of["ltoes"] == {Group.LEFT_LEG}
    assert of["rclavicle"] == of["rthumb"] == {Group.RIGHT_ARM}


@pytest.mark.parametrize("convention", RIGS)
def test_every_joint_has_a_group_and_every_group_its_carrier(convention: str) -> None:
    skeleton, _ = build(RIGS[convention])
    roles = assign_roles(skeleton)
    groups = groups_of(skeleton, roles)
    assert all(groups)
    shared = [j for j, own in enumerate(groups) if len(own) > 1]
    assert set(shared) == {
        roles.require(Role.PELVIS),
        *(roles.joints(Role.SPINE) or roles.joints(Role.PELVIS))[-1:],
    }
    for group, limb in LIMBS.items():
        held = [j for role in limb for j in roles.joints(role)]
        assert all(groups[j] == {group} for j in held)


# What the user says


def test_the_map_is_above_all_evidence() -> None:
    skeleton, _ = build(RIGS["smpl"])
    wrist, hand = (skeleton.names.index(name) for name in ("L_Wrist", "L_Hand"))
    roles = assign_roles(skeleton, override={Role.LEFT_HAND: (hand,), Role.RIGHT_TOE: ()})
    assert roles.joints(Role.LEFT_HAND) == (hand,)
    assert roles.roles[wrist] is None
    assert roles.joints(Role.RIGHT_TOE) == ()
    assert roles.confidence[hand] == 1.0
    assert roles.reasons[hand] == "given by the map"


def test_a_refused_body_is_taken_with_a_map_that_suffices() -> None:
    """A quadruped as somebody on all fours: the map says so, nothing else is inferred."""
    skeleton, right = build(
        RIGS["lafan1"].replace("Arm", "Frontleg").replace("Shoulder", "Frontclav")
    )
    skeleton = replace(skeleton, names=tuple(f"joint_{j}" for j in range(len(skeleton))))
    bare = replace(skeleton, offsets=skeleton.offsets * 0, end_offsets=skeleton.end_offsets * 0)
    given_ = {role: (j,) for j, role in enumerate(right) if role and "leg" in role.value}
    with pytest.raises(SkeletonError, match="lacks pelvis"):
        assign_roles(bare, override=given_)
    roles = assign_roles(bare, override={**given_, Role.PELVIS: (0,)})
    assert {str(r) for r in roles.roles if r} == {"pelvis", *map(str, given_)}


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ({Role.HEAD: (0,), Role.PELVIS: (0,)}, "'Hips' is given to head and to pelvis"),
        ({Role.LEFT_FOOT: (1, 2)}, "left_foot is given 2 joints"),
        ({Role.HEAD: (99,)}, "joint 99; expected 0 to 21"),
        (
            {Role.LEFT_LOWER_LEG: (4,)},
            "left_foot 'LeftFoot' .* is not below left_lower",
        ),
    ],
)
def test_a_map_that_makes_no_sense_is_refused(
    override: dict[Role, tuple[int, ...]], message: str
) -> None:
    skeleton, _ = build(RIGS["lafan1"])
    with pytest.raises(SkeletonError, match=message):
        assign_roles(skeleton, override=override)


# Any tree of joints

WORDS = """
    left right l r upper lower arm leg hand foot toe hip knee head neck spine Hips Shoulder wing
    front back twist finger 1 2 01 ankle 足 左 _ . : - tail root
    """
JOINT_NAMES = st.lists(st.sampled_from(WORDS.split()), min_size=1, max_size=4).map("".join)


def check_sound(skeleton: Skeleton, roles: RoleMap) -> None:
    check_chains(skeleton, roles)
    for role in Role:
        one = role in (Role.PELVIS, Role.LEFT_UPPER_LEG, Role.LEFT_LOWER_LEG, Role.RIGHT_LOWER_LEG)
        several = role in (Role.SPINE, Role.NECK)
        assert one <= len(roles.joints(role)) <= (99 if several else 1)
    assert all(0 <= c <= 1 for c in roles.confidence)
    assert all(roles.reasons)
    assert all(groups_of(skeleton, roles))


@settings(max_examples=150, deadline=None)
@given(
    names=st.lists(JOINT_NAMES, min_size=1, max_size=30),
    reach=st.integers(1, 6),
    seed=st.integers(0, 2**32 - 1),
    scale=st.sampled_from([0.0, 1e-9, 0.2, 1e6]),
    mirror=st.booleans(),
    frames=st.sampled_from([None, 0, 1, 3]),
)
def test_any_tree_is_mapped_soundly_or_refused(
    names: list[str], reach: int, seed: int, scale: float, mirror: bool, frames: int | None
) -> None:
    count = len(names)
    rng = np.random.default_rng(seed)
    parents = [-1, *(int(rng.integers(max(0, j - reach), j)) for j in range(1, count))]
    offsets = scale * rng.normal(size=(count, 3))
    if mirror:  # pairs of bones, as bodies have them
        offsets[2::2] = offsets[1:-1:2] * [1, -1, 1]
    skeleton = Skeleton(tuple(names), np.array(parents), offsets, np.arange(count) == 0)
    motion = None
    if frames is not None:
        rotations = quat_from_rotvec(rng.normal(size=(frames, count, 3)))
        motion = Motion(skeleton, 0.03, rng.normal(size=(frames, 3)), rotations)
    try:
        roles = assign_roles(skeleton, motion)
    except SkeletonError:
        return
    check_sound(skeleton, roles)


@settings(max_examples=100, deadline=None)
@given(
    convention=st.sampled_from(sorted(RIGS)),
    renamed=st.dictionaries(st.integers(0, 60), JOINT_NAMES, max_size=12),
    bent=st.integers(0, 2**32 - 1),
    moves=st.booleans(),
)
def test_misleading_names_never_give_an_unsound_map(
    convention: str, renamed: dict[int, str], bent: int, moves: bool
) -> None:
    skeleton, right = build(RIGS[convention])
    names = tuple(renamed.get(j, name) for j, name in enumerate(skeleton.names))
    skeleton = replace(skeleton, names=names)
    motion = walk(skeleton, right, frames=5)
    turns = quat_from_rotvec(np.random.default_rng(bent).normal(size=(1, len(names), 3)))
    motion = replace(motion, rotations=quat_mul(motion.rotations, turns))
    try:
        roles = assign_roles(skeleton, motion if moves else None)
    except SkeletonError:
        return
    check_sound(skeleton, roles)


@pytest.mark.parametrize("role", Role)
def test_a_roles_side_and_part_make_its_name_again(role: Role) -> None:
    assert "_".join(filter(None, (role.side, role.part))) == role.value
    assert role.side in ("", "left", "right")
    assert role.mirrored.mirrored is role
    assert (role.mirrored is role) == (role.side == "")
    assert role.mirrored.part == role.part
