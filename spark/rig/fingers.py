"""Fingers: which joint is which bone of which finger of a hand.

Names tell the finger, and the order below the hand tells the bone. Conventions name fingers
(`LeftHandIndex1`, `f_index.01.L`, `CC_Base_L_Mid1`) or count them from the thumb on (`finger2-1.L`,
`Bip01 L Finger01`, `LeftFinger1Proximal`). Of a hand without such names its build tells them.
"""

import re
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from spark.rig.aliases import FINGERS, METACARPAL, TIP
from spark.rig.finger_build import fingers_by_build, metacarpals
from spark.rig.name_hints import split_name
from spark.rig.nulls import nulls_of
from spark.rig.roles import HANDS, RoleMap
from spark.skeleton import Skeleton

FINGER_NAMES = tuple(dict.fromkeys(FINGERS.values()))
"""The five fingers, from the thumb on."""
ALL_FINGERS = "fingers"
"""One joint for all of them, or for all but the thumb."""

_PREFIX = "(?:l|r|left|right|左|右)?(?:hand)?"
_NAMED = re.compile(rf"{_PREFIX}({'|'.join(FINGERS)})(?:finger)?s?")
_COUNTED = re.compile(rf"{_PREFIX}(?:fingers?|指)")
_PHALANGES = 3  # of a finger; a fourth joint is a tip
_SAME_PLACE = 1e-3  # [m] files round their numbers


class FingerBone(NamedTuple):
    """A bone of a finger: its hand's side, the finger, and its number from the palm outwards.

    0 is the metacarpal, inside the palm; 1 to 3 are the phalanges. A thumb's metacarpal bends as a
    phalanx does, and is its first.
    """

    side: str
    finger: str
    number: int


def finger_bones(skeleton: Skeleton, roles: RoleMap) -> dict[FingerBone, int]:
    """The joints of a rig's fingers. Tips, which have no bone below them, are left out; so are
    hands without names that aren't built alike."""
    hands = {role.side: roles.joint(role) for role in HANDS}
    found = [_bones_of(skeleton, hand, side) for side, hand in hands.items() if hand is not None]
    alike = len(found) == 2 and len({frozenset(b[1:] for b in bones) for bones, _ in found}) == 1
    return {b: j for bones, named in found if named or alike for b, j in bones.items()}


def palms_of(skeleton: Skeleton, roles: RoleMap) -> dict[int, int]:
    """For each hand, the joint that its fingers turn with: the hand or, where it bends in a joint
    of its own, the last one that carries all of them but the thumb.

    In recordings of CMU `lwrist` twists and `lhand` below it bends; their best-known conversion to
    BVH has `LeftFingerBase` for it, in the same place as the hand.
    """
    return {hand: _palm_of(skeleton, hand) for role in HANDS for hand in roles.joints(role)}


def _palm_of(skeleton: Skeleton, hand: int) -> int:
    fingers = {j for j, finger in fingers_below(skeleton, hand).items() if finger != "thumb"}
    palm = hand
    while True:
        carrying = [j for j in skeleton.children[palm] if fingers.intersection(skeleton.subtree(j))]
        if len(carrying) != 1:
            return palm
        below = carrying[0]
        if below in fingers:
            fingers.remove(below)
            if not fingers or np.linalg.norm(skeleton.offsets[below]) > _SAME_PLACE:
                return palm
        palm = below


def _bones_of(skeleton: Skeleton, hand: int, side: str) -> tuple[dict[FingerBone, int], bool]:
    """The joints of a hand's fingers, and whether names tell them."""
    found: dict[FingerBone, int] = {}
    fingers, named = _told_below(skeleton, hand)
    nulls = nulls_of(skeleton)
    fingers.pop(_palm_of(skeleton, hand), None)
    chains: dict[str, list[int]] = {}
    for joint, finger in fingers.items():
        chain = chains.setdefault(finger, [])
        tip = TIP.intersection(split_name(skeleton.names[joint]))
        if not tip and joint not in nulls and (not chain or chain[-1] in skeleton.ancestors(joint)):
            chain.append(joint)
    for finger, chain in chains.items():
        palm = _in_palm([split_name(skeleton.names[j]) for j in chain], finger)
        if not named:
            palm = 0 if finger == "thumb" else metacarpals(skeleton, chain)
        for joint in chain[palm - 1 : palm]:
            found[FingerBone(side, finger, 0)] = joint
        for number, joint in enumerate(chain[palm:][:_PHALANGES], start=1):
            found[FingerBone(side, finger, number)] = joint
    return found, named


def fingers_below(skeleton: Skeleton, hand: int) -> dict[int, str]:
    """The joints of fingers below a hand, parents first, and the finger: by name or, where no name
    tells one, by build."""
    return _told_below(skeleton, hand)[0]


def _told_below(skeleton: Skeleton, hand: int) -> tuple[dict[int, str], bool]:
    """The same, and whether names tell them."""
    if named := _named_below(skeleton, hand):
        return named, True
    built = zip(FINGER_NAMES, fingers_by_build(skeleton, hand), strict=False)
    return dict(sorted((j, finger) for finger, chain in built for j in chain)), False


def _named_below(skeleton: Skeleton, hand: int) -> dict[int, str]:
    """The joints below a hand whose names tell a finger, parents first, and the finger."""
    pieces = {j: split_name(skeleton.names[j]) for j in skeleton.subtree(hand)[1:]}
    named = {j: finger for j, words in pieces.items() if (finger := _named(words))}
    counts = {j: _count(words) for j, words in pieces.items() if j not in named}
    counted = {j: count for j, count in counts.items() if count is not None}
    fingers = _fingers_of_counts(skeleton, counted, "thumb" in named.values())
    return dict(sorted((named | fingers).items()))


def _named(pieces: Sequence[str]) -> str | None:
    """The finger that a name's pieces name."""
    matches = (_NAMED.fullmatch(piece) for piece in pieces)
    return next((FINGERS[match[1]] for match in matches if match), None)


def _count(pieces: Sequence[str]) -> str | None:
    """The digits behind the word finger, of which the first counts fingers, or "" without any;
    None where that word is not there.

    "0", "01" and "02" are the bones of finger 0 (Biped), and so are "0" and "1", "0" and "2".
    """
    for i, piece in enumerate(pieces):
        if _COUNTED.fullmatch(piece):
            digits = [p for p in pieces[i + 1 : i + 3] if p.isdecimal()]
            return str(int(digits[0])) if len(digits) > 1 else "".join(digits)
    return None


def _fingers_of_counts(
    skeleton: Skeleton, counts: Mapping[int, str], has_thumb: bool
) -> dict[int, str]:
    """The fingers of counted joints: from the thumb on or, where that has a name, from the index.

    Joints without a number, with a single one other than Biped's 0, or with numbers that go on
    along a finger are one finger for all.
    """
    numbers = sorted({int(digits[0]) for digits in counts.values() if digits})
    nested = any(
        digits[:1] and counts.get(above, "")[:1] not in ("", digits[0])
        for j, digits in counts.items()
        for above in skeleton.ancestors(j)
    )
    if nested or (len(numbers) < 2 and "0" not in counts.values()):
        return dict.fromkeys(counts, ALL_FINGERS)
    first = numbers[0] if has_thumb else min(numbers[0], 1)
    names = FINGER_NAMES[1:] if has_thumb else FINGER_NAMES
    return {
        j: names[int(digits[0]) - first] if digits else ALL_FINGERS
        for j, digits in counts.items()
        if int(digits[:1] or 0) - first < len(names)
    }


def _in_palm(names: Sequence[Sequence[str]], finger: str) -> int:
    """How many of a finger's joints, from the palm outwards, lie inside the palm: those that are
    called so, and a helper above a joint of the same name (`__Index1_L`, `Index1_L`)."""
    called = [finger != "thumb" and bool(METACARPAL.intersection(pieces)) for pieces in names]
    twice = [above == below for above, below in pairwise(names)]
    inside = [i for i, holds in enumerate(called, start=1) if holds]
    inside += [i for i, holds in enumerate(twice, start=1) if holds]
    return max(inside, default=0)
