"""Which characters and motions training sees: the cells sc/uc x sm/um of the paper's tables."""

import hashlib
import math
import re
from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

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


def characters_and_motions(files: Sequence[Path]) -> list[tuple[str | None, str]]:
    """What the files' names say of whose motions they are, and the motions. None: the folder says
    whose it is.

    `Mousey@Gangnam Style` is Mousey's, as downloads for game engines are called. In a folder of
    several characters, one of the paper's in front says it too (`castle_guard_01_run`): there most
    files begin with one of them, and not all with the same. In a character's own folder `Mutant
    Idle` is a motion.
    """
    in_front = [None if _is_known(file.parent.name) else _in_front(file.stem) for file in files]
    count: Counter[Path] = Counter(file.parent for file in files)
    named: dict[Path, list[str]] = defaultdict(list)
    for file, found in zip(files, in_front, strict=True):
        if found:
            named[file.parent].append(_plain(found[0]))
    several = {
        folder
        for folder, names in named.items()
        if len(set(names)) > 1 and len(names) > count[folder] / 2
    }
    return [
        _before_at(file.stem)
        or (found if found and file.parent in several else None)
        or (None, file.stem)
        for file, found in zip(files, in_front, strict=True)
    ]


def _before_at(stem: str) -> tuple[str, str] | None:
    who, _, what = (part.strip() for part in stem.partition("@"))
    return (who, what) if who and what else None


def _in_front(stem: str) -> tuple[str, str] | None:
    """The paper's character that a name begins with, as it is spelt there, and the rest."""
    for name in sorted(_KNOWN, key=len, reverse=True):
        spelt = r"[\W_]*".join(map(re.escape, name.split()))
        found = re.match(rf"({spelt})[\W_]+(?=[^\W_])", stem, re.IGNORECASE)
        if found:
            return found[1], stem[found.end() :]
    return None


def _is_known(folder: str) -> bool:
    return any(_plain(name) in (_plain(folder), _unnumbered(folder)) for name in _KNOWN)


def motions_of(names: Iterable[str]) -> dict[str, str]:
    """The motion of each name: the first of the names that are spellings of one. Case and
    separators don't count, nor does the number that a browser gives to another download of a name
    (`Samba Dancing (1)`)."""
    first: dict[str, str] = {}
    names = sorted(set(names))
    return {name: first.setdefault(_spelt(name), name) for name in names}


def seen_motions(names: Iterable[str], seed: int) -> dict[str, bool]:
    """Whether training sees each motion; all spellings of one alike."""
    motions = motions_of(names)
    drawn = _draw(sorted(set(motions.values())), "motions", seed)
    return {name: drawn[motion] for name, motion in motions.items()}


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


def _spelt(motion: str) -> str:
    """What all spellings of a motion's name have in common."""
    unnumbered = re.sub(r"(\s*\(\d+\))+\s*$", "", motion)
    return re.sub(r"[\W_]+", " ", unnumbered).strip().casefold() or motion


def _plain(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())
