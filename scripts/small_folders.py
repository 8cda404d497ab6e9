"""What recorded pairs of few characters teach about all others.

Usage: python scripts/small_folders.py FOLDER [SIZE...] (a folder with one folder a character)

Of each size as many folders are drawn as stand in FOLDERS. What is learned from one is measured on
every other pair onto characters that are not in it, beside legs fitted by proportions alone; feet
are held in both. Prints Markdown: the mean over characters of the MSE's share that is left, over
all folders and in the worst one; the share of pairs that are more than 5 and 50 % worse; the worst
pair.
"""

import sys
from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import numpy as np

from scripts.characters_bench import METHODS, compare, read, shared_motions
from scripts.recorded_folds import SEED, plain_name, recorded_method
from spark.evaluation.cases import performances
from spark.network.recorded import HabitsOf
from spark.training.recorded_learning import learn_recorded
from spark.training.recorded_pairs import recorded_pairs
from spark.training.recorded_ridge import fit_ridge
from spark.training.same_motion import same_motion
from spark.transfer.foot_lock import lock_feet

SIZES, FOLDERS = ("8", "12", "18", "24"), 6


def main(folder: str, *sizes: str) -> None:
    motions = shared_motions(Path(folder))
    clips = {path: read(path) for paths in motions.values() for path in paths}
    named = [(a, b) for paths in motions.values() for a in paths for b in paths if a != b]
    pairs = [(a, b) for a, b in named if same_motion(clips[a][0], clips[b][0])][::2]
    plain = METHODS["legs fitted, feet held"]
    before = {
        (a, b): compare(plain(clips[a][0], clips[b][1].rig), clips[b][1])[0].mse for a, b in pairs
    }
    found = [replace(p, character=plain_name(p.character)) for p in performances(Path(folder))]
    characters = sorted({p.character for p in found})
    print("| | left | worst folder | 5 % worse | 50 % worse | worst pair |")
    print("|---|---|---|---|---|---|")
    for size in map(int, sizes or SIZES):
        shares: dict[str, list[float]] = defaultdict(list)
        ratios: dict[str, list[float]] = defaultdict(list)
        for seed in range(FOLDERS):
            order = np.random.default_rng([SEED, size, seed]).permutation(len(characters))
            own = {characters[k] for k in order[:size]}
            known = recorded_pairs([p for p in found if p.character in own])
            if not known.enough:
                continue
            learned = learn_recorded(known)
            told: dict[str, HabitsOf] = {"likeness": learned.told, "ridge": fit_ridge(known)}
            for name, habits in told.items():
                method = recorded_method(learned, habits)
                by_target: dict[str, list[tuple[float, float]]] = defaultdict(list)
                for a, b in pairs:
                    if b.parent.name in own:
                        continue
                    source, truth = clips[a][0], clips[b][1]
                    after = compare(lock_feet(source, method(source, truth.rig)), truth)[0].mse
                    by_target[b.parent.name].append((before[a, b], after))
                    ratios[name].append(after / before[a, b])
                means = np.mean([np.mean(scores, 0) for scores in by_target.values()], 0)
                shares[name].append(float(means[1] / means[0]))
        for name, left in shares.items():
            ratio = np.array(ratios[name])
            print(
                f"| {name}, {size} characters | {np.mean(left):.2f} | {max(left):.2f} | "
                f"{100 * (ratio > 1.05).mean():.0f} % | {100 * (ratio > 1.5).mean():.1f} % | "
                f"{ratio.max():.1f} |",
                flush=True,
            )


if __name__ == "__main__":
    main(*sys.argv[1:])
