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

_KNOWN = (*TRAINING, *UNSEEN)

# The share of motions, and of characters that the paper doesn't name, that training doesn't see.
HELD_OUT = 0.2


def seen_characters(names: Iterable[str], seed: int) -> dict[str, bool]:
    """Whether training sees each character: the paper's as it has them, the others drawn.

    A second body of one of the paper's characters (`Mousey 2`) is that character too.
    """
    known = {_plain(name): name in TRAINING for name in _KNOWN}
    names = sorted(set(names))
    seen = {
        name: next((known[p] for p in (_plain(name), _unnumbered(name)) if p in known), None)
        for name in names
    }
    drawn = _draw([name for name in names if seen[name] is None], "characters", seed)
    return {name: bool(drawn.get(name) if given is None else given) for name, given in seen.items()}


def character_and_motion(stem: str, folder: str) -> tuple[str | None, str]:
    """What a file's name says of whose motion it is, and the motion: `Mousey@Gangnam Style`, as
    downloads for game engines are called, or one of the paper's characters in front, where the
    folder is not called after one. None: the folder says whose it is."""
    who, at, what = (part.strip() for part in stem.partition("@"))
    if at and who and what:
        return who, what
    if not any(_plain(name) in (_plain(folder), _unnumbered(folder)) for name in _KNOWN):
        for name in sorted(_KNOWN, key=len, reverse=True):
            spelt = r"[\W_]*".join(map(re.escape, name.split()))
            found = re.match(rf"({spelt})[\W_]+(?=[^\W_])", stem, re.IGNORECASE)
            if found:
                return found[1], stem[found.end() :]
    return None, stem


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
        return hashlib.sha256(f"{seed}/{what}/{name}".encode(errors="surrogateescape")).hexdigest()

    held_out = set(sorted(names, key=rank)[:count])
    return {name: name not in held_out for name in names}


def _unnumbered(name: str) -> str:
    """The plain name without the number that a folder's second body gets."""
    return _plain(re.sub(r" \d+$", "", name))


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())
