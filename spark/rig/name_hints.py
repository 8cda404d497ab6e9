"""What a joint's name says: which joint of a limb it may be, on which side, or why it is none.

Names are cut into words (`LeftUpLeg`, `thigh_l`, `lfemur`, `Bip01 L Thigh`, `左ひざ`); the words
say the side and the part.
"""

import re
import unicodedata
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import lru_cache

from spark.rig.aliases import (
    ASIDE,
    AXES,
    FORELEG,
    HINGES,
    LEFT,
    MEANINGS,
    MODIFIERS,
    NOISE,
    RIGHT,
    SPECIFIC,
    SPELLINGS,
)

_ON_THE_MIDLINE = {"spine", "neck", "chest", "back", "waist"}
_HINGED = {*AXES - {"roll"}, *HINGES}  # in a robot's names
_VERTEBRA = re.compile(r"([lct])(\d{1,2})")
_HALF = re.compile(r"([ul])(arm|leg|farm)")  # upper or lower, where the name has its side already
_PIECES = re.compile(r"[A-Z]+(?=[A-Z][a-z])|[A-Z]?[a-z]+|[A-Z]+|\d+|[^\W\d_A-Za-z]+")

_ACCENTS = re.compile("[\u0300-\u036f]")  # of Latin letters, once they are apart from these

_WORDS = (
    {word for key in MEANINGS for word in key.split()}
    | set(SPELLINGS)
    | set(ASIDE)
    | MODIFIERS
    | NOISE
    | AXES
)
_SPELT = sorted(w for w in {*MEANINGS, *SPELLINGS, *ASIDE} if len(w) > 3 and w.isalpha())
_WHOLE = "|".join(
    sorted((re.escape(w) for w in _WORDS if len(w) > 2 or not w.isascii()), key=len, reverse=True)
)
_SIDES = "left|right|左|右"
_COMPOUND = re.compile(
    rf"(?P<before>{_SIDES}|l|r)?(?P<words>(?:up|lo|{_WHOLE})+?)(?P<after>{_SIDES}|l|r)?"
)
_SPLIT = re.compile(rf"{_WHOLE}|up|lo")


@dataclass(frozen=True)
class NameHint:
    """What a name says. `parts` gives roles without their side and how surely the name means them.

    `aside` tells why the joint is none of the roles ("a finger"); `foreleg` marks a front leg,
    `wing` a wing: limbs in the place of arms. `unread`: no rule reads the name, which has a word
    that is not known; its parts, if any, are the name encoder's (`spark.rig.name_votes`).
    """

    side: str = ""
    parts: dict[str, float] = field(default_factory=dict)
    aside: str = ""
    foreleg: bool = False
    unread: bool = False


def read_names(names: Sequence[str]) -> list[NameHint]:
    """What each name of a skeleton says; a prefix or suffix that most names share says nothing."""
    cut = [split_name(name) for name in names]
    if len(names) >= 5:
        _strip_common(cut, 0)
        _strip_common(cut, -1)
    axes = any(piece in _HINGED for pieces in cut for piece in pieces)
    return [_read(tuple(pieces), axes) for pieces in cut]


def split_name(name: str) -> list[str]:
    """The pieces of a name between capitals, digits and other signs, in lower case and without its
    namespace and accents: left, hand, index, 1 of `mixamorig:LeftHandIndex1`."""
    name = unicodedata.normalize("NFKC", _ACCENTS.sub("", unicodedata.normalize("NFKD", name)))
    name = re.split(r"[:|]", name)[-1]
    return [piece.lower() for piece in _PIECES.findall(name)]


def _strip_common(cut: list[list[str]], end: int) -> None:
    """Take away, in place, the words that most names begin (0) or end (-1) with, and of words that
    mean a joint or a side those of all names."""
    for _ in range(4):
        counts = Counter(pieces[end] for pieces in cut if len(pieces) > 1)
        if not counts:
            return
        word, count = counts.most_common(1)[0]
        meaningful = word in LEFT | RIGHT or word in MEANINGS or word in ASIDE
        most = len(cut) if meaningful and word != "root" else 0.7 * len(cut)
        if count < most:
            return
        for pieces in cut:
            if len(pieces) > 1 and pieces[end] == word:
                pieces.pop(end)


@lru_cache(maxsize=4096)
def _read(pieces: tuple[str, ...], axes: bool) -> NameHint:
    if vertebra := _VERTEBRA.fullmatch("".join(pieces)):
        return NameHint(parts={"neck" if vertebra[1] == "c" else "spine": 0.7})
    words, numbers, unknown = _words(pieces)
    side = "left" if words & LEFT else ""
    if words & RIGHT:
        side = "" if side else "right"
    words -= LEFT | RIGHT
    if axes:
        words -= AXES
    for word in sorted(words & ASIDE.keys()):
        # "NeckTwist" and "SpineMiddle" are the neck and the spine themselves.
        if not (words & _ON_THE_MIDLINE and word in ("twist", "middle")):
            return NameHint(side, aside=ASIDE[word])
    parts, foreleg = _parts(words, bool(side))
    if axes and "shoulder" in words:
        parts = {"upper_arm": 1.0}  # its hinges: robots have no clavicles
    if side and set(parts) <= {"pelvis", "spine", "neck", "head"}:
        return NameHint(
            side, aside="beside the midline" if parts else "", unread=unknown and not parts
        )
    if "foot" in parts and numbers and numbers[0] > 0:
        parts = {"foot": 0.5, "toe": 0.7}
    doubt = 0.6 if unknown else 1.0
    if set(parts) - {"spine", "neck", "wing"}:
        # Of a joint and its numbered companions the first is meant.
        doubt *= max(0.4, 1.0 - 0.08 * sum(min(n, 9) for n in numbers))
    sure = {part: doubt * s for part, s in parts.items()}
    return NameHint(side, sure, "", foreleg, unread=unknown and not parts)


def _words(pieces: tuple[str, ...]) -> tuple[set[str], list[int], bool]:
    """The known words of a name, its numbers, and whether something in it is not known."""
    words: list[str] = []
    numbers: list[int] = []
    unknown = False
    sided = any(piece in LEFT | RIGHT for piece in pieces)
    for piece in pieces:
        if piece.isdigit():
            numbers.append(int(piece[:4]))
        elif sided and (half := _HALF.fullmatch(piece)):
            words += ["upper" if half[1] == "u" else "lower", half[2]]
        elif found := _known(piece):
            words += found
        else:
            unknown = True
    if unknown and (found := _known("".join(p for p in pieces if not p.isdigit()))):
        # "LUArm" is cut as LU + Arm; as one word it is l + uarm.
        words, unknown = found, False
    if unknown:
        words += [word for piece in pieces if not _known(piece) for word in _misspelt(piece)]
    spelled = " ".join(SPELLINGS.get(word, word) for word in words)
    return set(spelled.split()), numbers, unknown


@lru_cache(maxsize=4096)
def _known(piece: str) -> list[str]:
    if piece in _WORDS or piece in LEFT or piece in RIGHT:
        return [piece]
    if match := _COMPOUND.fullmatch(piece):
        around = [side for side in (match["before"], match["after"]) if side]
        return [*around, *_SPLIT.findall(match["words"])]
    return []


@lru_cache(maxsize=4096)
def _misspelt(piece: str) -> list[str]:
    """The word that is `piece` but for a letter, or for two swapped, where only one joint has such.
    A short one has to begin as that word does: few people miss the first letter."""
    near = [
        word
        for word in _SPELT
        if abs(len(word) - len(piece)) < 2
        and _one_off(word, piece)
        and (len(piece) > 3 or word[0] == piece[0])
    ]
    return near[:1] if len({SPELLINGS.get(word, word) for word in near}) == 1 else []


def _one_off(a: str, b: str) -> bool:
    """Whether one letter is added, left out, or another, or two neighbours are swapped."""
    same = next((i for i, (x, y) in enumerate(zip(a, b, strict=False)) if x != y), None)
    if same is None:
        return len(a) != len(b)
    if a[same : same + 2] == b[same : same + 2][::-1] and a[same + 2 :] == b[same + 2 :]:
        return True
    longer, shorter = (a, b) if len(a) >= len(b) else (b, a)
    return longer[same + 1 :] == shorter[same + (len(a) == len(b)) :]


def _parts(words: set[str], sided: bool) -> tuple[dict[str, float], bool]:
    """The meanings of a set of words, and whether they are a front leg's."""
    foreleg = "front" in words and bool(words & FORELEG.keys() or "leg" in words)
    upper, lower = "upper" in words, "lower" in words
    if foreleg:
        return _foreleg_parts(words, upper, lower), True
    if words & {"wrist", "palm"}:  # "HandWrist" and "HandPalm": the second word tells which
        words = words - {"hand"}
    for limb in ("arm", "leg"):
        if limb in words and (upper or lower) and not words & SPECIFIC:
            return MEANINGS[f"{'upper' if upper else 'lower'} {limb}"], False
    if "hip" in words and sided:
        return MEANINGS["hip joint" if "joint" in words else "sided hip"], False
    specific = [word for word in sorted(words & MEANINGS.keys()) if word in SPECIFIC]
    general = [word for word in sorted(words & MEANINGS.keys()) if word not in SPECIFIC]
    if specific and "leg" in general:
        # "AnkleLeg" is a leg's segment above the foot, and still the ankle where nothing else is.
        doubt = 0.3 if "ankle" in specific else 0.6
        return {part: doubt * s for part, s in MEANINGS[specific[0]].items()}, False
    for word in (*specific, *general):
        return MEANINGS[word], False
    return {}, False


def _foreleg_parts(words: set[str], upper: bool, lower: bool) -> dict[str, float]:
    for word, part in FORELEG.items():
        if word in words:
            return {part: 0.7}
    if upper or lower:
        return {"upper_arm" if upper else "forearm": 0.7}
    return {"upper_arm": 0.4, "forearm": 0.4}
