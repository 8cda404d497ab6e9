"""What recorded pairs teach about characters that were left out, in the rows of characters_bench.

Usage: python scripts/recorded_folds.py FOLDER [STEP [SIZE...]] (a folder with one folder a
character; with STEP, every so many of the pairs; a SIZE of network is WIDTHxHEADSxBLOCKSxSTEPS)

Characters and motions are left out a sixth at a time. In each fold the linear model and networks
learn from the pairs of the others; the pairs onto characters that were left out are measured, each
once: uc+sm where training has seen the motion, uc+um where not. Of the first fold, so are the pairs
onto other characters (sc+sm, sc+um).
"""

import re
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import torch

from scripts.characters_bench import METHODS, Feet, compare, read, shared_motions
from spark.evaluation.cases import performances
from spark.evaluation.metrics import Score, mean_score
from spark.network.recorded import (
    BodyTokens,
    Habits,
    HabitsOf,
    KnownBodies,
    as_recorded,
    tokens_of,
)
from spark.rig.rig import Rig
from spark.training.recorded_learning import learn_recorded
from spark.training.recorded_net import habits_of
from spark.training.recorded_pairs import RecordedPairs, recorded_pairs
from spark.training.recorded_ridge import fit_ridge
from spark.training.same_motion import same_motion
from spark.transfer.analytic import transfer
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.foot_lock import lock_feet

FOLDS, SEED = 6, 0
SIZES = "48x2x2x100", "128x4x4x30"  # the presets `tiny`, and `default` and `paper`
Method = Callable[[CanonicalMotion, Rig], CanonicalMotion]


def main(folder: str, step: str = "1", *sizes: str) -> None:
    torch.set_num_threads(1)
    motions = shared_motions(Path(folder))
    clips = {path: read(path) for paths in motions.values() for path in paths}
    named = [(a, b) for paths in motions.values() for a in paths for b in paths if a != b]
    pairs = [(a, b) for a, b in named if same_motion(clips[a][0], clips[b][0])]
    found = [replace(p, character=_plain(p.character)) for p in performances(Path(folder))]
    characters = _folds(sorted({p.character for p in found}))
    held_motions = _folds(sorted(motions))
    rows: dict[str, dict[str, dict[str, list[tuple[Score, Feet]]]]] = defaultdict(
        lambda: defaultdict(lambda: defaultdict(list))
    )
    for number, (fold, held) in enumerate(zip(characters, held_motions, strict=True)):
        known = recorded_pairs([p for p in found if p.clip.name not in held]).without(fold)
        habits: dict[str, HabitsOf] = {"ridge": fit_ridge(known)}
        for size in sizes or SIZES:
            habits[f"network {size}"], near = _network(known, size, f"fold {number}, {size}")
        methods: dict[str, Method] = dict(METHODS)
        for name, of_body in habits.items():
            plain = partial(_recorded, of_body, near)
            methods |= {name: plain, f"{name}, feet held": partial(_held, plain)}
        for a, b in pairs[:: int(step)]:
            unseen = b.parent.name in fold
            if unseen or not number:
                cell = f"{'uc' if unseen else 'sc'}+{'um' if a.stem in held else 'sm'}"
                source, truth = clips[a][0], clips[b][1]
                for name, method in methods.items():
                    score = compare(method(source, truth.rig), truth)
                    rows[name][cell][b.parent.name].append(score)
    cells = ("sc+sm", "sc+um", "uc+sm", "uc+um")
    print("| MSE (root-relative), 1e-6 |", " | ".join(cells), "| unseen | toes | sunk |")
    print("|---" * (len(cells) + 4) + "|")
    for name, by_cell in rows.items():
        unseen = _joined([by_cell["uc+sm"], by_cell["uc+um"]])
        told = [_shown(by_cell[cell]) for cell in cells] + [_shown(unseen)]
        feet = [f for scores in unseen.values() for _, f in scores]
        toes = np.nanmean([f.toes for f in feet]) / np.nanmean([f.truth_toes for f in feet])
        sunk = 100 * np.mean([f.sunk for f in feet])
        print(f"| {name} | {' | '.join(told)} | {toes:.2f} | {sunk:.1f} % |")
    counts = (f"{cell} {sum(map(len, rows['copy'][cell].values()))}" for cell in cells)
    print(f"\nPairs: {', '.join(counts)}; {len(named) - len(pairs)} of one name move differently")


def _network(known: RecordedPairs, size: str, what: str) -> tuple[HabitsOf, KnownBodies]:
    """What a network of this size learns, and the bodies that it knows."""
    width, heads, blocks, steps = map(int, size.split("x"))
    began = time.process_time()
    learned = learn_recorded(known, width=width, heads=heads, blocks=blocks, steps=steps)
    print(
        f"{what}: {len(known.pairs)} pairs, {time.process_time() - began:.0f} CPU s, "
        f"left {learned.trust.left:.2f}, reach {learned.trust.reach:.2f}, "
        f"trust {learned.trust.shares.round(2).tolist()}",
        file=sys.stderr,
        flush=True,
    )

    def network(body: BodyTokens) -> Habits:
        return habits_of(learned.net, [body], learned.trust.shares)[0]

    return network, learned.known


def _recorded(
    habits: HabitsOf, known: KnownBodies, source: CanonicalMotion, rig: Rig
) -> CanonicalMotion:
    bodies = tokens_of(source.rig), tokens_of(rig)
    share = known.nearness(bodies[0]) * known.nearness(bodies[1])
    return as_recorded(habits, source, transfer(source, rig), share, bodies=bodies)


def _held(plain: Method, source: CanonicalMotion, rig: Rig) -> CanonicalMotion:
    return lock_feet(source, plain(source, rig))


def _folds(names: list[str]) -> list[set[str]]:
    order = np.random.default_rng(SEED).permutation(len(names))
    return [{names[i] for i in order[k::FOLDS]} for k in range(FOLDS)]


def _plain(character: str) -> str:
    """The folder of a body that is the second one of a folder."""
    return re.sub(r" \d+$", "", character)


def _joined(
    cells: list[dict[str, list[tuple[Score, Feet]]]],
) -> dict[str, list[tuple[Score, Feet]]]:
    out: dict[str, list[tuple[Score, Feet]]] = defaultdict(list)
    for cell in cells:
        for who, scores in cell.items():
            out[who] += scores
    return out


def _shown(of_one: dict[str, list[tuple[Score, Feet]]]) -> str:
    mean = mean_score({who: [score for score, _ in scores] for who, scores in of_one.items()})
    return f"{1e6 * mean.mse:.1f} ({1e6 * mean.relative_mse:.1f})"


if __name__ == "__main__":
    main(*sys.argv[1:])
