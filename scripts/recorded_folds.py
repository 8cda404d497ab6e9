"""What recorded pairs teach about characters that were left out, in the rows of characters_bench.

Usage: python scripts/recorded_folds.py FOLDER [STEP] (a folder with one folder a
character; with STEP, every so many of the pairs)

Characters and motions are left out a sixth at a time. In each fold likeness and the ridge
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
from pathlib import Path

import numpy as np

from scripts.characters_bench import METHODS, Feet, compare, read, shared_motions
from spark.evaluation.cases import performances
from spark.evaluation.metrics import Score, mean_score
from spark.network.recorded import HabitsOf, as_recorded, tokens_of
from spark.rig.rig import Rig
from spark.training.recorded_learning import Recorded, learn_recorded
from spark.training.recorded_pairs import RecordedPairs, recorded_pairs
from spark.training.recorded_ridge import Ridge, fit_ridge
from spark.training.same_motion import same_motion
from spark.transfer.analytic import transfer
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.own_soles import on_own_soles
from spark.transfer.refine import refined

FOLDS, SEED = 6, 0
Method = Callable[[CanonicalMotion, Rig], CanonicalMotion]


def main(folder: str, step: str = "1") -> None:
    motions = shared_motions(Path(folder))
    clips = {path: read(path) for paths in motions.values() for path in paths}
    named = [(a, b) for paths in motions.values() for a in paths for b in paths if a != b]
    pairs = [(a, b) for a, b in named if same_motion(clips[a][0], clips[b][0])]
    found = [replace(p, character=plain_name(p.character)) for p in performances(Path(folder))]
    characters = _folds(sorted({p.character for p in found}))
    held_motions = _folds(sorted(motions))
    rows: dict[str, dict[str, dict[str, list[tuple[Score, Feet]]]]] = defaultdict(
        lambda: defaultdict(lambda: defaultdict(list))
    )
    for number, (fold, held) in enumerate(zip(characters, held_motions, strict=True)):
        known = recorded_pairs([p for p in found if p.clip.name not in held]).without(fold)
        methods: dict[str, Method] = dict(METHODS)
        learned = _learned(known, f"fold {number}")
        methods |= _both("likeness", recorded_method(learned, learned.told))
        methods |= _both("ridge", recorded_method(learned, fit_ridge(known)))
        for a, b in pairs[:: int(step)]:
            held_out = b.parent.name in fold
            if held_out or not number:
                cell = f"{'uc' if held_out else 'sc'}+{'um' if a.stem in held else 'sm'}"
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


def _learned(known: RecordedPairs, what: str) -> Recorded:
    """What the pairs say; prints what it takes."""
    began = time.process_time()
    learned = learn_recorded(known)
    print(
        f"{what}: {len(known.pairs)} pairs, {time.process_time() - began:.1f} CPU s, "
        f"left {learned.left:.2f}, reach {learned.known.reach:.2f}",
        file=sys.stderr,
        flush=True,
    )
    return learned


def recorded_method(learned: Recorded, habits: HabitsOf) -> Method:
    """By these habits, on bodies near those that were learned from; as far as they are sure, unless
    they are the ridge's."""

    def method(source: CanonicalMotion, rig: Rig) -> CanonicalMotion:
        bodies = tokens_of(source.rig), tokens_of(rig)
        share = learned.known.nearness(bodies[0]) * learned.known.nearness(bodies[1])
        doubt = None if isinstance(habits, Ridge) else learned.told.doubt(*bodies)
        moved = transfer(source, rig)
        fitted = as_recorded(habits, source, moved, share, bodies=bodies, doubt=doubt)
        return on_own_soles(source, fitted)

    return method


def _both(name: str, plain: Method) -> dict[str, Method]:
    return {
        name: plain,
        f"{name}, as `retarget`": lambda s, rig: refined(s, plain(s, rig)),
    }


def _folds(names: list[str]) -> list[set[str]]:
    order = np.random.default_rng(SEED).permutation(len(names))
    return [{names[i] for i in order[k::FOLDS]} for k in range(FOLDS)]


def plain_name(character: str) -> str:
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
