"""Does the report find what is spoilt on a body that is not the source's, in soles of its own?

Usage: python -m scripts.floor_bench FOLDER [STEP] (recorded pairs as `scripts.characters_bench`
takes them; with STEP, every so many of them)

Prints Markdown: for the recorded answer itself, for copied rotations and for `retarget`, the share
of implausible frames beside the source, clean and spoilt, and in brackets the AUC, as
`scripts.report_bench` has it.
"""

import sys
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Float

import spark_sim
from scripts.characters_bench import METHODS, read, shared_motions
from scripts.corruptions import CORRUPTIONS, Corruption
from scripts.report_bench import auc
from sim.report import Subject, assess
from sim.report.thresholds import HUMAN_HIP_HEIGHT
from spark.errors import SkeletonError
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.rig.roles import Group
from spark.training.same_motion import same_motion
from spark.transfer.canonical import from_canonical, to_canonical
from spark.transfer.leg_ik import leg_of, move_ankles

HELD, OURS = "copy, feet held", "`retarget`"
SMOOTH = 9  # frames


def up(motion: Motion, rig: Rig, rng: np.random.Generator, *, height: float) -> Motion:
    """Moved up by `height` [m, of an adult] throughout."""
    return _moved(motion, rig, np.full(len(motion), height))


def partly(motion: Motion, rig: Rig, rng: np.random.Generator, *, height: float) -> Motion:
    """Moved up by `height` [m, of an adult] in the last two fifths."""
    late = height * (np.arange(len(motion)) >= 0.6 * len(motion))
    padded = np.pad(late, SMOOTH // 2, mode="edge")
    return _moved(motion, rig, np.convolve(padded, np.ones(SMOOTH) / SMOOTH, "valid"))


def slowly(motion: Motion, rig: Rig, rng: np.random.Generator, *, height: float) -> Motion:
    """Moved up more and more, by `height` [m, of an adult] at the end."""
    return _moved(motion, rig, np.linspace(0.0, height, len(motion)))


def left_foot(motion: Motion, rig: Rig, rng: np.random.Generator, *, height: float) -> Motion:
    """The left foot moved up by `height` [m, of an adult] throughout, by hip and knee."""
    leg = leg_of(rig, Group.LEFT_LEG)
    if leg is None:
        raise SkeletonError("a leg without a knee")
    move = np.zeros((len(motion), 3))
    move[:, 2] = height * rig.hip_height / HUMAN_HIP_HEIGHT
    return from_canonical(move_ankles(to_canonical(motion, rig), [(leg, move)]))


KINDS: dict[str, Corruption] = {
    "clean": lambda motion, rig, rng: motion,
    **{f"{100 * h:+.0f} cm": partial(up, height=h) for h in (-0.02, -0.03, 0.02, 0.03, 0.05)},
    "the last two fifths -3 cm": partial(partly, height=-0.03),
    "the last two fifths +6 cm": partial(partly, height=0.06),
    "sinks to -4 cm": partial(slowly, height=-0.04),
    "rises to +6 cm": partial(slowly, height=0.06),
    "left foot -3 cm": partial(left_foot, height=-0.03),
    **{kind: CORRUPTIONS[kind] for kind in ("slide 0.3 m/s", "jitter 2°", "lean 15°")},
}


def main(folder: str, step: str = "1") -> None:
    found: dict[str, dict[str, dict[int, float]]] = defaultdict(lambda: defaultdict(dict))
    for pair, (source, made) in enumerate(pairs(Path(folder), int(step))):
        for name, subject in made.items():
            rng = np.random.default_rng(pair)
            for kind, corrupt in KINDS.items():
                try:
                    motion = corrupt(subject.motion, subject.rig, rng)
                except SkeletonError:
                    continue
                report = assess(replace(subject, motion=motion), source=source)
                found[kind][name][pair] = report.implausible
    names = [*found["clean"]]
    print(f"{pair + 1} pairs\n\n| % of the frames (AUC) | {' | '.join(names)} |")
    print("|---|" + "---:|" * len(names))
    for kind, rows in found.items():
        cells = []
        for name in names:
            spoilt = rows[name]
            clean = [found["clean"][name][k] for k in spoilt]
            told = "" if kind == "clean" else f" ({auc(clean, [*spoilt.values()]):.2f})"
            cells.append(f"{100 * np.mean([*spoilt.values()]):.1f}{told}")
        print(f"| {kind} | {' | '.join(cells)} |")


def pairs(folder: Path, step: int) -> Iterator[tuple[Subject, dict[str, Subject]]]:
    """The source of every `step`th pair, and what there is of it on the other character."""
    shared = shared_motions(folder)
    clips = {path: read(path) for paths in shared.values() for path in paths}
    named = [(a, b) for paths in shared.values() for a in paths for b in paths if a != b]
    same = [(a, b) for a, b in named if same_motion(clips[a][0], clips[b][0])]
    for a, b in same[::step]:
        source, answer = (spark_sim.load(path) for path in (a, b))
        rig = clips[b][1].rig
        made = {"the recorded answer": Subject(answer.motion, answer.rig)}
        for name in (HELD, OURS):
            made[name] = Subject(from_canonical(METHODS[name](clips[a][0], rig)), rig)
        yield Subject(source.motion, source.rig), made


def _moved(motion: Motion, rig: Rig, heights: Float[np.ndarray, "T"]) -> Motion:
    path = np.outer(heights * rig.hip_height / HUMAN_HIP_HEIGHT, [0.0, 0.0, 1.0])
    translations = motion.translations
    if translations is not None:
        translations = translations.copy()
        translations[:, 0] += path
    return replace(motion, root_pos=motion.root_pos + path, translations=translations)


if __name__ == "__main__":
    main(*sys.argv[1:])
