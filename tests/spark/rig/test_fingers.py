"""Fingers are told on any rig: by side, finger and bone, from names as the field writes them."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from spark.io.recording import read_recording
from spark.rig.fingers import ALL_FINGERS, FINGER_NAMES, FingerBone, finger_bones, palms_of
from spark.rig.role_assignment import assign_roles
from spark.rig.roles import Role, RoleMap
from spark.skeleton import Skeleton
from tests.helpers.recordings import recordings

THREE_TIMES_FIVE = {
    "mixamo": ("mixamorig:{Left}Hand{Thumb}{n}", "Thumb Index Middle Ring Pinky"),
    "motionbuilder": ("{Left}Hand{Thumb}{n}", "Thumb Index Middle Ring Pinky"),
    "rigify": ("DEF-{Thumb}.0{n}.{L}", "thumb f_index f_middle f_ring f_pinky"),
    "unreal": ("{Thumb}_0{n}_{l}", "thumb index middle ring pinky"),
    "vrm": ("J_Bip_{L}_{Thumb}{n}", "Thumb Index Middle Ring Little"),
    "makehuman": ("{Thumb}-{n}.{L}", "finger1 finger2 finger3 finger4 finger5"),
    "iclone": ("CC_Base_{L}_{Thumb}{n}", "Thumb Index Mid Ring Pinky"),
    "daz": ("{l}{Thumb}{n}", "Thumb Index Mid Ring Pinky"),
    "smplx": ("{left}_{Thumb}{n}", "thumb index middle ring pinky"),
    "advanced skeleton": (
        "{Thumb}{n}_{L}",
        "ThumbFinger IndexFinger MiddleFinger RingFinger PinkyFinger",
    ),
    "mikumikudance": ("{左}{Thumb}{n}", "親指 人指 中指 薬指 小指"),
    "a game's": ("hand_{l}_{Thumb}_{n}", "thumb pointer middle ring pinkie"),
    "one word": ("{l}{Thumb}{n}", "thumb index middle ring pinky"),
    "biped": ("Bip01 {L} {Thumb}{m}", "Finger0 Finger1 Finger2 Finger3 Finger4"),
    "valve": ("ValveBiped.Bip01_{L}_{Thumb}{m}", "Finger0 Finger1 Finger2 Finger3 Finger4"),
    "rokoko": ("{Left}{Thumb}{bone}", "Finger1 Finger2 Finger3 Finger4 Finger5"),
    "unity": ("{Left} {Thumb} {bone}", "Thumb Index Middle Ring Little"),
    "counted twice": ("{l}_{Thumb}_0{n}", "finger_01 finger_02 finger_03 finger_04 finger_05"),
    "thumb by name": ("{l}_{Thumb}_{n}", "thumb finger1 finger2 finger3 finger4"),
}


def written(template: str, finger: str, bone: int, side: str) -> str:
    return template.format(
        Thumb=finger,
        n=bone,
        m=bone - 1 or "",
        bone=("Proximal", "Intermediate", "Distal")[bone - 1],
        Left=side.capitalize(),
        left=side,
        L=side[0].upper(),
        l=side[0],
        左={"left": "左", "right": "右"}[side],
    )


def hands(*rows: tuple[str, str]) -> tuple[Skeleton, RoleMap]:
    """A pelvis with two hands, and joints below them by name and parent's name."""
    names = ["pelvis", "left hand", "right hand", *(name for name, _ in rows)]
    parents = [-1, 0, 0, *(names.index(parent) for _, parent in rows)]
    skeleton = Skeleton(
        tuple(names),
        np.array(parents),
        np.ones((len(names), 3)),
        np.arange(len(names)) == 0,
    )
    roles = (Role.PELVIS, Role.LEFT_HAND, Role.RIGHT_HAND, *[None] * len(rows))
    return skeleton, RoleMap(roles, (1.0,) * len(names), ("",) * len(names))


def found(*rows: tuple[str, str]) -> dict[tuple[str, int], str]:
    """What is found below the hands: finger and number to name."""
    skeleton, roles = hands(*rows)
    bones = finger_bones(skeleton, roles)
    return {(b.finger, b.number): skeleton.names[j] for b, j in bones.items()}


@pytest.mark.parametrize("convention", THREE_TIMES_FIVE)
def test_every_bone_of_every_finger_of_both_hands(convention: str) -> None:
    template, words = THREE_TIMES_FIVE[convention]
    rows: list[tuple[str, str]] = []
    expected: dict[FingerBone, str] = {}
    for side in ("left", "right"):
        for finger, word in zip(FINGER_NAMES, words.split(), strict=True):
            above = f"{side} hand"
            for bone in (1, 2, 3):
                name = written(template, word, bone, side)
                rows.append((name, above))
                expected[FingerBone(side, finger, bone)] = above = name
            rows.append((f"{above}_end", above))
    skeleton, roles = hands(*rows)
    bones = finger_bones(skeleton, roles)
    assert {bone: skeleton.names[j] for bone, j in bones.items()} == expected


def test_what_lies_in_the_palm_is_bone_0_but_for_the_thumb() -> None:
    assert found(
        ("LeftInHandIndex", "left hand"),
        ("LeftHandIndex1", "LeftInHandIndex"),
        ("thumb_metacarpal_l", "left hand"),
        ("thumb_01_l", "thumb_metacarpal_l"),
        ("__Ring1_L", "left hand"),
        ("Ring1_L", "__Ring1_L"),
        ("Ring2_L", "Ring1_L"),
        ("middle_metacarpal_l", "left hand"),
        ("middle_01_l", "middle_metacarpal_l"),
    ) == {
        ("index", 0): "LeftInHandIndex",
        ("index", 1): "LeftHandIndex1",
        ("thumb", 1): "thumb_metacarpal_l",
        ("thumb", 2): "thumb_01_l",
        ("ring", 0): "__Ring1_L",
        ("ring", 1): "Ring1_L",
        ("ring", 2): "Ring2_L",
        ("middle", 0): "middle_metacarpal_l",
        ("middle", 1): "middle_01_l",
    }


@pytest.mark.parametrize(
    "names",
    [("lfingers",), ("LeftFingerBase",), ("finger_01_l", "finger_02_l", "finger_03_l"), ("左指",)],
)
def test_one_chain_for_all_fingers_is_no_single_finger(names: tuple[str, ...]) -> None:
    rows = zip(names, ("left hand", *names), strict=False)
    assert found(*rows, ("lthumb", "left hand")) == {
        **{(ALL_FINGERS, n): name for n, name in enumerate(names, start=1)},
        ("thumb", 1): "lthumb",
    }


@pytest.mark.parametrize(
    ("palm", "rows"),
    [
        ("lhand", [("lhand", "left hand"), ("lfingers", "lhand"), ("lthumb", "left hand")]),
        ("FingerBase", [("FingerBase", "left hand"), ("LeftHandIndex1", "FingerBase")]),
        ("left hand", [("finger_01_l", "left hand"), ("finger_02_l", "finger_01_l")]),
        ("left hand", [("LeftHandThumb1", "left hand"), ("LeftHandIndex1", "left hand")]),
        ("left hand", [("index_metacarpal_l", "left hand"), ("index_01_l", "index_metacarpal_l")]),
        ("left hand", [("lthumb", "left hand"), ("lthumb2", "lthumb")]),
        ("left hand", [("hold_l", "left hand")]),
    ],
)
def test_the_palm_is_what_carries_all_fingers(palm: str, rows: list[tuple[str, str]]) -> None:
    """Beyond the hand it is no finger, but for one that begins where the hand does."""
    skeleton, roles = hands(*rows)
    skeleton.offsets[[name == "FingerBase" for name in skeleton.names]] = 0
    palms = palms_of(skeleton, roles)
    left, right = roles.require(Role.LEFT_HAND), roles.require(Role.RIGHT_HAND)
    assert [skeleton.names[palms[left]], palms[right]] == [palm, right]
    assert palms[left] not in finger_bones(skeleton, roles).values()


def test_what_hangs_on_a_hand_and_is_no_finger_is_left_alone() -> None:
    assert found(("sword", "left hand"), ("String_L", "left hand"), ("index_l", "pelvis")) == {}


# [m] A left hand along X, its thumb to Y: where fingers begin from the wrist, and their bones.
KNUCKLES = {
    "thumb": (0.03, 0.03, -0.01),
    "index": (0.09, 0.025, 0.0),
    "middle": (0.092, 0.003, 0.002),
    "ring": (0.087, -0.017, 0.0),
    "little": (0.079, -0.035, -0.004),
}
BONES = (0.038, 0.026, 0.022)


def built(
    order: tuple[str, ...] = FINGER_NAMES,
    *,
    left_out: tuple[str, ...] = (),
    in_palm: float = 0.0,
    mirrored: bool = True,
    turn: Rotation | None = None,
) -> tuple[Skeleton, RoleMap, dict[FingerBone, int]]:
    """Two hands whose joints have numbers for names, their fingers in this order, and the bones.
    Fingers end in a tip; with `in_palm` a metacarpal begins at so much of the way to the knuckle.
    The left hand lacks what is `left_out`, the right one too where it is `mirrored`."""
    parents, offsets = [-1, 0, 0], [(0.0, 0, 1), (0.0, 0.7, 0), (0.0, -0.7, 0)]
    expected: dict[FingerBone, int] = {}
    for hand, side in enumerate(("left", "right"), start=1):
        across = np.array([1.0, 1.0 if side == "left" else -1.0, 1.0])
        for finger in order:
            if finger in left_out and (side == "left" or mirrored):
                continue
            steps = [np.array(KNUCKLES[finger]), *([b, 0.0, 0.0] for b in BONES)]
            first = 1
            if in_palm and finger != "thumb":
                steps[:1] = [in_palm * steps[0], (1 - in_palm) * steps[0]]
                first = 0
            above = hand
            for number, step in enumerate(steps, start=first):
                parents.append(above)
                above = len(parents) - 1
                placed = across * step
                offsets.append(tuple(placed if turn is None else turn.apply(placed)))
                if number <= 3:
                    expected[FingerBone(side, finger, number)] = above
    count = len(parents)
    skeleton = Skeleton(
        tuple(f"j{j}" for j in range(count)),
        np.array(parents),
        np.array(offsets, dtype=float),
        np.arange(count) == 0,
    )
    roles = (Role.PELVIS, Role.LEFT_HAND, Role.RIGHT_HAND, *[None] * (count - 3))
    return skeleton, RoleMap(roles, (1.0,) * count, ("",) * count), expected


@pytest.mark.parametrize("in_palm", [0.0, 0.3])
@pytest.mark.parametrize("seed", range(4))
def test_fingers_without_names_are_told_by_where_they_begin(seed: int, in_palm: float) -> None:
    """In any order, and however the hand's own axes lie."""
    order = tuple(np.random.default_rng(seed).permutation(FINGER_NAMES).tolist())
    turn = Rotation.random(random_state=seed)
    skeleton, roles, expected = built(order, in_palm=in_palm, turn=turn)
    assert len(expected) == 2 * (15 + 4 * bool(in_palm))
    assert finger_bones(skeleton, roles) == expected


def test_names_stand_above_build() -> None:
    skeleton, roles, _ = built()
    names = list(skeleton.names)
    names[3] = "little"  # which begins as a thumb does
    bones = finger_bones(replace(skeleton, names=tuple(names)), roles)
    assert {bone: j for bone, j in bones.items() if bone.side == "left"} == {
        FingerBone("left", "little", 1): 3
    }


@pytest.mark.parametrize("left_out", [("thumb",), ("ring",), ("thumb", "little")])
def test_what_is_not_built_as_a_hand_is_left_alone(left_out: tuple[str, ...]) -> None:
    for mirrored in (True, False):
        skeleton, roles, _ = built(left_out=left_out, mirrored=mirrored)
        assert finger_bones(skeleton, roles) == {}


@pytest.mark.parametrize(
    "path",
    recordings(
        "mixamo_pairs/_tposes/Mousey.bvh",
        "mixamo_pairs/*/*_64f.bvh",
        "zoo/m2m_human.bvh",
        "zoo/makehuman_*.bvh",
        "zoo/ad_rokoko*.bvh",
    ),
)
def test_build_tells_fingers_of_rigs_as_their_names_do_or_not_at_all(path: Path) -> None:
    motion = read_recording(path).motion
    skeleton = motion.skeleton
    roles = assign_roles(skeleton, motion)
    named = finger_bones(skeleton, roles)
    assert named
    bare = replace(skeleton, names=tuple(f"j{j}" for j in range(len(skeleton))))
    found = finger_bones(bare, roles)
    assert {bone: j for bone, j in found.items() if bone.number == 1}.items() <= named.items()
