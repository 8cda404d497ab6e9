"""How many joints hold a wrong role: recorded rigs, the ecosystem's names, made conventions.

Usage: python -m scripts.count_roles [DATA] (the folder of recordings, by default that beside the
checkout; without one, the rigs that are built here alone)

Recorded rigs are counted against tables that were written by looking at them
(tests/helpers/role_tables.py), Mixamo's by its own names. The rigs that are built come as they are,
as caricatures (each part of the body 0.4 to 2.5 times as long), both with every word misspelt, and,
of each convention, with joints dropped, split and scaled. Prints Markdown, and each wrong joint.
"""

import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from spark.demo.sample import sample_rig
from spark.errors import SkeletonError
from spark.io.reading import SUFFIXES, read_motion
from spark.network.features import body_features
from spark.rig.name_conventions import CONVENTIONS
from spark.rig.role_assignment import assign_roles
from spark.rig.roles import Role
from spark.skeleton import Skeleton
from spark.training.variants import random_variant, same_body
from tests.helpers.recordings import DATA
from tests.helpers.rigs import RIGS, build
from tests.helpers.role_tables import MOTIONBUILDER_3, expected, table

Roles = tuple[Role | None, ...]
Rigs = Iterator[tuple[str, Skeleton, Roles, Roles]]
"""What a rig is called, its skeleton, its joints' roles as they are and as they are found."""


def mixamo(data: Path) -> Rigs:
    """A recording of each Mixamo character, and those without a motion."""
    paths = {p.parent: p for p in sorted(data.glob("mixamo*/[!_]*/*")) if p.suffix in SUFFIXES}
    for path in (*paths.values(), *sorted(data.glob("mixamo_pairs/_tposes/*.bvh"))):
        # Kaya's and one Granny's legs hang from a "Pelvis" where the "Hips" are.
        names = read_motion(path).motion.skeleton.names
        by_pelvis = any(name.endswith("Pelvis") for name in names)
        pelvis = "pelvis=Pelvis" if by_pelvis else "pelvis=Hips"
        yield _recorded(path, table(MOTIONBUILDER_3.replace("pelvis=Hips", pelvis)))


def in_tables(pattern: str, data: Path) -> Rigs:
    """The recordings of a pattern whose rigs walk on two legs."""
    for path in sorted(data.glob(pattern)):
        if text := expected(path):
            yield _recorded(path, table(text))


def _recorded(path: Path, known: dict[str, str]) -> tuple[str, Skeleton, Roles, Roles]:
    motion = read_motion(path).motion
    names = (name.split(":")[-1] for name in motion.skeleton.names)
    right = tuple(Role(known[name]) if name in known else None for name in names)
    found = assign_roles(motion.skeleton, motion).roles
    return f"{path.parent.name}/{path.name}", motion.skeleton, right, found


def ecosystem(caricatures: int) -> Rigs:
    """The ecosystem's rigs; with `caricatures`, so many of each."""
    for name, chains in RIGS.items():
        skeleton, right = build(chains)
        for seed in range(caricatures or 1):
            made = _caricature(skeleton, right, seed) if caricatures else skeleton
            yield f"{name} {seed}", made, right, assign_roles(made).roles


def _caricature(skeleton: Skeleton, right: Roles, seed: int) -> Skeleton:
    rng = np.random.default_rng(seed)
    parts = [role.part if role else "" for role in right]
    factors = {part: np.exp(rng.normal(0, 0.45)) for part in sorted(set(parts))}
    offsets = skeleton.offsets * np.array([factors[part] for part in parts])[:, None]
    return replace(skeleton, offsets=np.where(np.arange(len(right))[:, None], offsets, 0.0))


def misspelt(spoil: Callable[[str, np.random.Generator], str], each: int = 6) -> Rigs:
    """`each` of the ecosystem's rigs and of their caricatures, with all words of four letters and
    more spoilt, but for sides."""
    for name, chains in RIGS.items():
        skeleton, right = build(chains)
        for seed in range(each):
            for made in (skeleton, _caricature(skeleton, right, seed)):
                rng = np.random.default_rng(seed)
                names = (_spoilt(joint, spoil, rng) for joint in made.names)
                made = replace(made, names=tuple(names))
                try:
                    found = assign_roles(made).roles
                except SkeletonError:
                    found = (None,) * len(made)
                yield f"{name} {seed}", made, right, found


def _spoilt(
    name: str, spoil: Callable[[str, np.random.Generator], str], rng: np.random.Generator
) -> str:
    def word(found: re.Match[str]) -> str:
        own = found[0]
        kept = len(own) < 4 or own.lower() in ("left", "right") or own == "mixamorig"
        return own if kept else spoil(own, rng)

    return _WORD.sub(word, name)


_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])")


def letter_missing(word: str, rng: np.random.Generator) -> str:
    k = int(rng.integers(1, len(word)))
    return word[:k] + word[k + 1 :]


def letters_swapped(word: str, rng: np.random.Generator) -> str:
    k = int(rng.integers(1, len(word) - 1))
    return word[:k] + word[k + 1] + word[k] + word[k + 2 :]


def three_letters(word: str, _: np.random.Generator) -> str:
    return word[:3]


def without_vowels(word: str, _: np.random.Generator) -> str:
    return word[0] + re.sub("[aeiou]", "", word[1:])


def conventions(each: int) -> Rigs:
    """Bodies made as training makes them, `each` named by every convention."""
    base = same_body(body_features(sample_rig("walker"))).body
    for convention in CONVENTIONS:
        for seed in range(each):
            rig = random_variant(base, np.random.default_rng(seed), convention).body.rig
            found = assign_roles(rig.skeleton).roles
            yield f"{convention} {seed}", rig.skeleton, rig.roles.roles, found


def main(folder: str = str(DATA)) -> None:
    data = Path(folder)
    groups: dict[str, Callable[[], Rigs]] = {
        "Mixamo's characters": partial(mixamo, data),
        **{
            f"recordings of {kind}": partial(in_tables, f"{kind}/*.bvh", data)
            for kind in ("zoo", "animateddrawings", "makehuman", "mesh2motion", "reactidle")
        },
        "the ecosystem's rigs": partial(ecosystem, 0),
        "their caricatures": partial(ecosystem, 40),
        "made conventions": partial(conventions, 42),
        **{
            f"misspelt: {told}": partial(misspelt, spoil)
            for told, spoil in (
                ("a letter missing", letter_missing),
                ("two letters swapped", letters_swapped),
                ("three letters", three_letters),
                ("no vowels", without_vowels),
            )
        },
    }
    print("| | rigs | with a wrong role | wrong joints | confused sides |\n|---|---|---|---|---|")
    told = []
    for group, rigs in groups.items():
        count = bad = joints = sides = 0
        for name, skeleton, right, found in rigs():
            count += 1
            missed = {
                joint: (str(a), str(b))
                for joint, a, b in zip(skeleton.names, right, found, strict=True)
                if a is not b
            }
            bad, joints = bad + bool(missed), joints + len(missed)
            for joint, (a, b) in missed.items():
                sides += {a.split("_")[0], b.split("_")[0]} == {"left", "right"}
                told.append(f"- {group}, {name}: {joint} is {a}, found {b}")
        if count:
            print(f"| {group} | {count} | {bad} | {joints} | {sides} |", flush=True)
    print("\n" + "\n".join(told))


if __name__ == "__main__":
    main(*sys.argv[1:])
