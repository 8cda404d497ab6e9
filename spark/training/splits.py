"""Which characters and motions training sees: the cells sc/uc x sm/um of the paper's tables."""

import hashlib
import math
import re
from collections.abc import Iterable, Mapping, Sequence

# Section 5: twelve characters to train on, seven to test on; three are in both.
TRAINING = (
    "Big Vegas",
    "Warrok W Kurniawan",
    "Michelle",
    "Amy",
    "Castle Guard 01",
    "Doozy",
    "Mousey",
    "Mutant",
    "Prisoner B Styperek",
    "Remy",
    "Goblin",
    "Skeletonzombie T Avelange",
)
UNSEEN = ("AJ", "Kaya", "Paladin J Nordstrom", "Peasant Man")

# The share of motions, and of characters that the paper doesn't name, that training doesn't see.
HELD_OUT = 0.2


def seen_characters(names: Iterable[str], seed: int) -> dict[str, bool]:
    """Whether training sees each character: the paper's as it has them, the others drawn."""
    known = {_plain(name): True for name in TRAINING} | {_plain(name): False for name in UNSEEN}
    names = sorted(set(names))
    drawn = _draw([name for name in names if _plain(name) not in known], "characters", seed)
    return {name: known.get(_plain(name), drawn.get(name, True)) for name in names}


def seen_motions(names: Iterable[str], seed: int) -> dict[str, bool]:
    """Whether training sees each motion."""
    return _draw(sorted(set(names)), "motions", seed)


def cells(
    clips: Sequence[tuple[str, str]], characters: Mapping[str, bool], motions: Mapping[str, bool]
) -> list[str]:
    """The cell of each clip, a character and a motion, as the paper names it; training uses
    `sc+sm`. A character whose every motion is unseen is not seen itself."""
    met = {who for who, motion in clips if characters[who] and motions[motion]}
    return [
        f"{'sc' if who in met else 'uc'}+{'sm' if motions[motion] else 'um'}"
        for who, motion in clips
    ]


def _draw(names: list[str], what: str, seed: int) -> dict[str, bool]:
    """All but the share that is held out: at least one, but never the only one.

    Names are ranked by a hash, so that a new one changes the places of few others.
    """
    count = math.ceil(HELD_OUT * len(names)) if len(names) > 1 else 0

    def rank(name: str) -> str:
        return hashlib.sha256(f"{seed}/{what}/{name}".encode()).hexdigest()

    held_out = set(sorted(names, key=rank)[:count])
    return {name: name not in held_out for name in names}


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())
