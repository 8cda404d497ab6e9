"""Roles: from names, from topology, from shape, and from all of them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spark.demo.sample import sample_rig
from spark.io.recording import read_recording
from spark.network.features import body_features
from spark.rig.name_conventions import CONVENTIONS
from spark.rig.name_hints import read_names
from spark.rig.role_assignment import assign_roles
from spark.rig.roles import Role
from spark.rotation import quat_from_rotvec, quat_mul
from spark.skeleton import Skeleton
from spark.training.variants import random_variant, same_body
from tests.helpers.recordings import recording, recordings
from tests.helpers.rigs import RIGS, build, walk
from tests.helpers.role_tables import (
    CMU_ASF,
    SAMPLES,
    as_strings,
    expected,
    known_recordings,
    table,
    wrong,
)


@pytest.mark.parametrize("path", known_recordings(*SAMPLES))
def test_roles_of_recordings_are_those_of_the_table(path: Path) -> None:
    text = expected(path)
    assert text is not None
    motion = read_recording(path).motion
    roles = assign_roles(motion.skeleton, motion)
    assert as_strings(motion.skeleton, roles) == table(text)
    assert all(c >= 0.8 for c, r in zip(roles.confidence, roles.roles, strict=True) if r)
    assert all(roles.reasons)


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
@pytest.mark.parametrize("spelling", ["bone_{:03d}", "{:x}q"])
def test_without_names_a_head_lies_below_its_crown(spelling: str, ends: bool) -> None:
    """And no head is a crown: of two joints of a neck the upper one is not taken for it."""
    for crowned in (True, False):
        chains = RIGS["mixamo"].replace("mixamorig:Head > mixamorig:LeftEye -", "")
        chains = chains.replace("mixamorig:Head > mixamorig:RightEye -", "")
        if not crowned:
            chains = chains.replace(" > mixamorig:HeadTop_End -", "")
            chains = chains.replace("mixamorig:Neck N", "mixamorig:Neck N > mixamorig:Neck1 N")
        skeleton, right = build(chains, ends=ends)
        if crowned:  # the builder's neck is as long as a head [m]
            head = right.index(Role.HEAD)
            skeleton.offsets[[head, head + 1]] = [[0.02, 0.0, 0.08], [0.0, 0.0, 0.18]]
        names = tuple(spelling.format(97 * j) for j in range(len(skeleton)))
        bare = replace(skeleton, names=names)
        roles = assign_roles(bare, walk(bare, right, turn=1.0))
        for role in (Role.NECK, Role.HEAD):
            assert [skeleton.names[j] for j in roles.joints(role)] == [
                name for name, own in zip(skeleton.names, right, strict=True) if own is role
            ]
        [note] = roles.notes
        assert f"sure what {names[right.index(Role.HEAD)]!r} is" in note


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


def test_reasons_say_where_a_role_comes_from() -> None:
    skeleton, _ = build(RIGS["unreal"])
    roles = assign_roles(skeleton)
    reason = dict(zip(skeleton.names, roles.reasons, strict=True))
    assert reason["thigh_l"] == "name 'thigh_l'"
    assert reason["thumb_01_l"] == "a finger, by its name"
    assert reason["calf_twist_01_l"] == "a twist bone, by its name"
    assert reason["ik_foot_l"] == "a helper, by its name"


@pytest.mark.parametrize("convention", RIGS)
def test_sure_names_do_not_lose_to_lengths(convention: str) -> None:
    """Bones of each part of the body 0.4 to 2.5 times as long (log-normal, 0.45): caricatures."""
    skeleton, right = build(RIGS[convention])
    for seed in range(5):
        rng = np.random.default_rng(seed)
        factors = {part: np.exp(rng.normal(0, 0.45)) for part in sorted(set(map(_part, right)))}
        offsets = skeleton.offsets * np.array([factors[_part(role)] for role in right])[:, None]
        odd = replace(skeleton, offsets=np.where(np.arange(len(right))[:, None], offsets, 0.0))
        assert wrong(odd, assign_roles(odd), right) == {}, seed


def _part(role: Role | None) -> str:
    return "" if role is None else role.part


@pytest.mark.parametrize("convention", ["mixamo", "unreal", "xsens"])
def test_sides_are_those_of_the_names_whatever_else_these_say(convention: str) -> None:
    """Nothing but a side in any name, on a body that is seen in a mirror, or not."""
    skeleton, right = build(RIGS[convention])
    sides = ["" if role is None or not role.side else f"{role.side}_" for role in right]
    names = tuple(f"{side}quux{j}" for j, side in enumerate(sides))
    flip = np.array([1.0, -1.0, 1.0])
    for offsets in (skeleton.offsets, skeleton.offsets * flip):
        odd = replace(skeleton, names=names, offsets=offsets)
        found = assign_roles(odd).roles
        said = {role.side for role in found if role and role.side}
        assert said == {"left", "right"}
        for side, role in zip(sides, found, strict=True):
            assert role is None or not side or f"{role.side}_" == side


def test_a_name_with_a_letter_wrong_still_says_its_joint() -> None:
    words = ["LeftSholder", "LeftForarm", "r_thgh", "klavicle_l", "Spne", "LeftLegg"]
    parts = [max(hint.parts, key=hint.parts.get, default="") for hint in read_names(words)]
    assert parts == ["clavicle", "forearm", "upper_leg", "clavicle", "spine", "lower_leg"]
    assert read_names(["LeftHad"])[0].parts == {}, "a head or a hand"
    assert read_names(["elv_angle_l"])[0].parts == {}, "neither pelvis nor ankle"


def test_a_half_of_a_limb_is_told_from_its_side() -> None:
    """`l_larm` is the left lower arm: the name has its side already. `larm` is the left arm."""
    words = ["l_larm", "r_larm", "r_uarm", "l_ufarm", "l_uleg", "r_lleg"]
    hints = read_names(words)
    assert [hint.side[0] for hint in hints] == [word[0] for word in words]
    parts = ["forearm", "forearm", "upper_arm", "forearm", "upper_leg", "lower_leg"]
    assert [set(hint.parts) for hint in hints] == [{part} for part in parts]
    assert read_names(["larm"])[0].parts["upper_arm"] > read_names(["larm"])[0].parts["forearm"]


def test_a_palm_on_a_wrist_is_not_the_hand() -> None:
    """Headsets track `LeftHandWrist` and, below it, `LeftHandPalm`: the hand turns at the wrist,
    however long the forearm."""
    skeleton, right = build(RIGS["headset"])
    for factor in (0.5, 2.0, 3.0):
        forearm = np.array([name.endswith("HandWrist") for name in skeleton.names])[:, None]
        odd = replace(skeleton, offsets=skeleton.offsets * np.where(forearm, factor, 1.0))
        odd = replace(odd, offsets=odd.offsets * np.where(_palms(skeleton), 4.0, 1.0))
        assert wrong(odd, assign_roles(odd), right) == {}


def _palms(skeleton: Skeleton) -> np.ndarray:
    return np.array([name.endswith("Palm") for name in skeleton.names])[:, None]


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_roles_of_made_rigs_are_those_they_were_made_with(convention: str) -> None:
    """Joints dropped, split and scaled, as in training, and named by one convention each."""
    base = same_body(body_features(sample_rig("walker"))).body
    for seed in range(6):
        rig = random_variant(base, np.random.default_rng(seed), convention).body.rig
        assert wrong(rig.skeleton, assign_roles(rig.skeleton), rig.roles.roles) == {}, seed


def test_a_mouse_with_short_upper_arms_has_shoulders() -> None:
    """Mixamo's Mousey: its upper arm is half as long as its forearm, no longer than the clavicle,
    and "LeftShoulder" alone could be either."""
    motion = read_recording(recording("mixamo_pairs/_tposes/Mousey.bvh")).motion
    roles = assign_roles(motion.skeleton, motion)
    table = dict(zip(motion.skeleton.names, roles.roles, strict=True))
    assert table["mixamorig:LeftShoulder"] is Role.LEFT_CLAVICLE
    assert table["mixamorig:LeftArm"] is Role.LEFT_UPPER_ARM
    assert table["mixamorig:RightForeArm"] is Role.RIGHT_FOREARM
    assert table["mixamorig:RightHand"] is Role.RIGHT_HAND


@pytest.mark.parametrize("convention", ["lafan1", "unreal", "robot"])
def test_what_all_names_share_says_nothing(convention: str) -> None:
    """Whatever it means elsewhere: every joint of a model called `Head Hunter 2` is no head."""
    skeleton, right = build(RIGS[convention])
    for word in ("head_hunter2_{}", "hand-{}", "{}_right", "Spine{}"):
        named = replace(skeleton, names=tuple(map(word.format, skeleton.names)))
        assert wrong(named, assign_roles(named), right) == {}


@pytest.mark.parametrize("chest", ["FaceUnit", "HeadRest"])
def test_what_carries_the_arms_is_hardly_a_head(chest: str) -> None:
    """By a doubtful name, of a body that begins with its trunk, as robots' do."""
    skeleton, right = build(
        f"""
        {chest} S > Waist S > Base P
        {chest} > {{l}}_upperarm U > {{l}}_forearm F > {{l}}_hand W
        Base > {{l}}_thigh T > {{l}}_shin K > {{l}}_foot A
        """
    )
    assert wrong(skeleton, assign_roles(skeleton), right) == {}


@pytest.mark.parametrize("wing", ["wing", "bone"])
@pytest.mark.parametrize("top", ["Neck", "top"])
def test_a_head_is_no_wing(wing: str, top: str) -> None:
    """Where no joint is named head, it is the one on the trunk that has no twin, or that is named
    as a neck, however much further wings reach and rise."""
    skeleton, right = build(
        f"""
        Hips P > Spine S > {top} H
        Spine > {{Left}}Arm U > {{Left}}ForeArm F > {{Left}}Hand W
        Hips > {{Left}}UpLeg T > {{Left}}Leg K > {{Left}}Foot A
        Spine > {wing}_{{L}} - > {wing}1_{{L}} - > {wing}2_{{L}} -
        """
    )
    wings = [j for j, role in enumerate(right) if role is None]
    sides = np.sign(skeleton.rest_positions[wings, 1])
    skeleton.offsets[wings] = np.stack([0 * sides - 0.05, 0.2 * sides, 0 * sides + 0.1], axis=-1)
    assert wrong(skeleton, assign_roles(skeleton, walk(skeleton, right)), right) == {}
