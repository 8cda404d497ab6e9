"""Fingers are told on any rig: by side, finger and bone, from names as the field writes them."""

import numpy as np
import pytest

from spark.rig.fingers import ALL_FINGERS, FINGER_NAMES, FingerBone, finger_bones
from spark.rig.roles import Role, RoleMap
from spark.skeleton import Skeleton

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


def test_what_hangs_on_a_hand_and_is_no_finger_is_left_alone() -> None:
    assert found(("sword", "left hand"), ("String_L", "left hand"), ("index_l", "pelvis")) == {}
