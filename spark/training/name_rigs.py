"""Rigs that nobody has made: the conventions' words mixed, and written as exporters write them.

What the name encoder learns from. Words come from the conventions that are given and from nowhere
else; beside them stand words without a meaning, which only the rest of the rig can explain.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np

from spark.inference.name_words import rig_words
from spark.inference.weights import OTHER
from spark.rig.name_conventions import CONVENTIONS, name_joints
from spark.rig.roles import Role

KINDS = tuple(dict.fromkeys(role.part for role in Role))

Named = tuple[str, str, str]
"""A joint's name, side and kind."""

# How often a rig is without a kind of joint.
_ABSENT = {"clavicle": 0.2, "toe": 0.2, "hand": 0.05, "neck": 0.1, "head": 0.03}
_OTHERS = (
    *("end", "nub", "tip", "sub", "eye", "ear"),
    *("jaw", "hair", "finger", "thumb", "breast", "buttock", "heel", "prop"),
    *("weapon", "camera", "tail", "twist", "roll", "helper", "joint", "marker"),
)
_FILLERS = ("bone", "bend", "base", "link", "part", "main", "01", "jnt", "def", "fk", "c", "m", "x")
_AFTER = ("end", "nub", "sub", "twist", "roll", "tip")
_SIDES = (
    *(("Left", "Right"), ("left", "right"), ("L", "R"), ("l", "r"), ("LEFT", "RIGHT")),
    *(("Lt", "Rt"), ("lft", "rgt"), ("左", "右")),
)
_CASES = (str.lower, str.lower, str.title, str.title, str.capitalize, str.upper)
_NUMBERS = ("{m}", "{n}", "0{n}", "_{n}", "_0{n}", ".00{n}", "{i}")
_PREFIXES = ("", "", "", "", "b_", "rig:", "Armature|", "Bip001 ", "Hero_", "jnt_", "DEF-", "SK_M_")
_SUFFIXES = ("", "", "", "", "_jnt", "_link", "Bone", "_joint", ".x")
_VOWELS = ("a", "e", "i", "o", "u", "ee", "oo", "ai", "ou")
_ONSETS = (*"bcdfghjklmnprstvwyz", "br", "ch", "cl", "dr", "fl", "gr", "pl", "sh", "sk", "st", "tr")
_CODAS = (
    *"bdgklmnprstxz",
    *[""] * 5,
    *("ck", "ft", "ll", "nd", "ng", "nt", "rm", "sh", "st"),
)

_T = TypeVar("_T")


def rig_of(convention: str, roles: Sequence[Role]) -> list[Named]:
    """The joints that hold `roles`, as `convention` names them."""
    names = name_joints(roles, convention)
    return [(name, role.side, role.part) for name, role in zip(names, roles, strict=True)]


def made_up_rig(rng: np.random.Generator, conventions: Sequence[str]) -> list[Named]:
    """A rig whose words are those of `conventions`."""
    roles = _roles(rng)
    first = _pick(conventions, rng)
    if rng.random() < 0.3:
        return rig_of(first, roles)
    stems = _stems(first)
    if rng.random() < 0.6:
        stems = _mixed(stems, conventions, rng)
    stems = _unclear(stems, conventions, rng)
    style = _Style.draw(rng)
    chains = {kind: _chain(kind, stems[kind], conventions, rng) for kind in ("spine", "neck")}
    rig: list[Named] = []
    counts: dict[Role, int] = {}
    for role in roles:
        side, kind = role.side, role.part
        count = counts[role] = counts.get(role, -1) + 1
        if kind in chains:
            words, number = chains[kind][count % len(chains[kind])], count // len(chains[kind])
            rig.append((style.write(words, side, number), side, kind))
        else:
            rig.append((style.write(stems[kind], side, None), side, kind))
    return rig + _others(stems, style, rng)


def _chain(kind: str, word: str, conventions: Sequence[str], rng: np.random.Generator) -> list[str]:
    """The words of the joints of one chain: one, several (Spine, Chest), or its parts."""
    how = rng.random()
    if how < 0.6:
        return [word]
    if how < 0.8:
        others = [_stems(_pick(conventions, rng))[kind] for _ in range(3)]
        return list(dict.fromkeys([word, *others]))
    parts = _pick((("lower", "upper"), ("low", "mid", "up"), ("Lower", "Middle", "Upper")), rng)
    return [f"{part} {word}" if how < 0.9 else f"{word} {part}" for part in parts]


def _roles(rng: np.random.Generator) -> list[Role]:
    absent = {kind for kind, chance in _ABSENT.items() if rng.random() < chance}
    roles = [role for role in Role if role.part not in absent]
    roles += [Role.SPINE] * int(rng.integers(0, 4))
    if "neck" not in absent and rng.random() < 0.25:
        roles.append(Role.NECK)
    alone = rng.random()
    if alone < 0.5:  # the two sides say the same: half of the rigs show one of them
        shown = "left" if alone < 0.25 else "right"
        roles = [role for role in roles if role.side in ("", shown)]
    return roles


@lru_cache
def _stems(convention: str) -> dict[str, str]:
    """The words of each kind of joint, without sides, numbers and what all names share."""
    templates = [CONVENTIONS[convention][kind] for kind in KINDS]
    blank = dict.fromkeys(("L", "l", "Left", "left", "LEFT", "左", "i", "n", "m"), "")
    words = rig_words([template.format(**blank) for template in templates])
    return {
        kind: " ".join(word for word in text.split() if not word.isdigit())
        for kind, text in zip(KINDS, words, strict=True)
    }


def _mixed(
    stems: dict[str, str], conventions: Sequence[str], rng: np.random.Generator
) -> dict[str, str]:
    """Some of the words replaced by those of other conventions, no word standing for two kinds."""
    mixed = dict(stems)
    for kind in rng.permutation(KINDS).tolist():
        if rng.random() < 0.4:
            word = _stems(_pick(conventions, rng))[kind]
            if word not in mixed.values():
                mixed[kind] = word
    return mixed


def _unclear(
    stems: dict[str, str], conventions: Sequence[str], rng: np.random.Generator
) -> dict[str, str]:
    """Words misspelt, shortened, doubled by another (HandWrist) or by one that means nothing."""
    out = dict(stems)
    filler = _pick(_FILLERS, rng) if rng.random() < 0.5 else _nonsense(rng)
    filled, before = 0.5 * (rng.random() < 0.25), rng.random() < 0.3
    for kind, word in stems.items():
        if rng.random() < 0.12:
            out[kind] = _misspelt(word, rng)
        if rng.random() < 0.04:
            out[kind] += f" {_stems(_pick(conventions, rng))[kind]}"
        if rng.random() < filled:
            out[kind] = f"{filler} {out[kind]}" if before else f"{out[kind]} {filler}"
    if rng.random() < 0.8:
        unknown = _pick((1, 1, 1, 2, 3), rng)
        for kind in rng.choice(KINDS, size=unknown, replace=False).tolist():
            out[kind] = _nonsense(rng)
    return out


def _misspelt(word: str, rng: np.random.Generator) -> str:
    how, at = rng.integers(5), int(rng.integers(len(word)))
    if how == 0:  # joined
        return word.replace(" ", "")
    if len(word) < 5:
        return word
    if how == 1:  # its vowels left out
        return word[0] + "".join(c for c in word[1:] if c not in "aeiou")
    if how == 2:  # cut short
        return word[: int(rng.integers(3, len(word)))].strip()
    if how == 3:  # a letter lost
        return (word[:at] + word[at + 1 :]).strip()
    return word[:at] + word[at] + word[at:]  # a letter twice


def _nonsense(rng: np.random.Generator) -> str:
    """A word of 2 to 9 letters that can be spoken."""
    parts = []
    for _ in range(rng.integers(1, 4)):
        parts += [_pick(_ONSETS, rng), _pick(_VOWELS, rng), _pick(_CODAS, rng)]
    return "".join(parts)[:9]


def _pick(options: Sequence[_T], rng: np.random.Generator) -> _T:
    return options[int(rng.integers(len(options)))]


@dataclass(frozen=True)
class _Style:
    """How one exporter writes: `prefix side between word number between side suffix`."""

    case: int
    between_words: str
    sides: tuple[str, str]
    side_first: bool
    between_side: str
    number: str
    prefix: str
    suffix: str

    @classmethod
    def draw(cls, rng: np.random.Generator) -> "_Style":
        between_words = _pick(("", "", "_", " ", "-"), rng)
        return cls(
            int(rng.integers(len(_CASES))),
            between_words,
            _pick(_SIDES, rng),
            bool(rng.random() < 0.5),
            _pick((between_words, "", "_", ".", " "), rng),
            _pick(_NUMBERS, rng),
            f"{_nonsense(rng)}_" if rng.random() < 0.2 else _pick(_PREFIXES, rng),
            _pick(_SUFFIXES, rng),
        )

    def write(self, words: str, side: str, count: int | None) -> str:
        """The name of a joint; `count` numbers a chain's joints from 0."""
        text = _CASES[self.case](words).replace(" ", self.between_words)
        if count is not None:
            text += self.number.format(i=count, n=count + 1, m=count or "")
        if side:
            mark = self.sides[side == "right"]
            parts = (mark, text) if self.side_first else (text, mark)
            text = self.between_side.join(parts)
        return f"{self.prefix}{text}{self.suffix}"


def _others(stems: dict[str, str], style: _Style, rng: np.random.Generator) -> list[Named]:
    """Joints that are none of the body's."""
    others = []
    for _ in range(rng.integers(0, 5)):
        side = _pick(("", "left", "right"), rng)
        if rng.random() < 0.5:
            word = f"{stems[_pick(KINDS, rng)]} {_pick(_AFTER, rng)}"
        else:
            word = _pick(_OTHERS, rng)
        if word not in stems.values():
            others.append((style.write(word, side, None), side, OTHER))
    return others
