"""What each step onto a character gives: a table, with one step left out at a time.

    python -m scripts.character_steps --data DIR [--only NAME...]

Three sets: every sixth of the recorded pairs of `scripts.characters_bench`; every ninth pair of the
rigs that docs/model.md names; and acrobats, dancers and who gets up, onto bodies of odd
proportions, six seconds of each. A name is what the steps themselves are called in the code.
"""

import argparse
from collections import defaultdict
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from itertools import permutations, product
from pathlib import Path
from types import ModuleType
from unittest.mock import patch

import numpy as np

import spark_sim
import spark_sim.retargeting
from scripts.characters_bench import METHODS, compare, read, shared_motions
from scripts.knees_bench import legs
from scripts.rigs_bench import measured, middle
from spark.evaluation.metrics import mean_score
from spark.training.same_motion import same_motion
from spark.transfer import analytic, foot_lock, hip_sway, leg_fit, over_floor, own_soles, refine
from spark.transfer.canonical import CanonicalMotion
from spark_sim.clips import Clip

SECONDS, STEP, PAIRS = 6.0, 6, 9
RIGS = (
    *("zoo/ad_*.bvh", "zoo/cmu_*.bvh", "zoo/m2m_bird.bvh", "zoo/m2m_human.bvh"),
    *("zoo/m2m_kaiju.bvh", "zoo/makehuman_*.bvh", "zoo/reactidle_*.bvh"),
    *("animateddrawings/jumping.bvh", "cmu_asf/cmu_02_01.bvh", "cmu_dance/cmu_05_10.bvh"),
    *("cmu_expmap/test_soccer_1.bvh", "deepmimic/deepmimic_walk.bvh", "makehuman/dance1.bvh"),
    *("mesh2motion/kaiju_Attack.bvh", "mixamo_pairs/Michelle/samba_dancing_594f.bvh"),
    "reactidle/004_acted.bvh",
)
ACROBATS = (
    *(
        f"deepmimic/deepmimic_{name}.bvh"
        for name in ("backflip", "cartwheel", "crawl", "getup_facedown", "roll", "spin", "kick")
    ),
    *("cmu_dance/cmu_05_06.bvh", "cmu_asf/cmu_02_06.bvh"),
)
ODD = (
    *("mixamo_pairs/_tposes/Mousey.bvh", "zoo/m2m_kaiju.bvh", "zoo/makehuman_walk.bvh"),
    *(
        "mixamo_pairs/Big_Vegas/breakdance_ready_64f.bvh",
        "mixamo_pairs/Ortiz/gangnam_style_372f.bvh",
    ),
)
SNAP = 15.0  # [degrees] by which a knee's turn changes between two frames, at 60 of them a second
NOTHING = np.array([1.0, 0.0, 0.0, 0.0])

# What is done in a step's place.
WITHOUT: dict[str, tuple[ModuleType, Callable[..., object]]] = {
    "from_rest_to_rest": (analytic, lambda source, moved: moved),
    "travel_scale": (leg_fit, lambda source, target: target.hip_height / source.hip_height),
    "on_own_soles": (own_soles, lambda source, moved, *_: moved),
    "_lying": (leg_fit, lambda source: np.zeros(len(source))),
    "_held": (foot_lock, lambda theirs, own, *_: np.zeros_like(own)),
    "_rolled": (foot_lock, lambda *soles: tuple(sole[..., :2].mean(axis=1) for sole in soles[:2])),
    "put_down": (foot_lock, lambda low, *_: np.zeros_like(low)),
    "hip_rise": (foot_lock, lambda source, moved, *_: np.zeros(len(moved))),
    "within_reach": (foot_lock, lambda moved, moves, _: (moved, moves)),
    "unfolded": (foot_lock, lambda moved, moves, *_: (moved, moves)),
    "swing_gently": (foot_lock, lambda moved, moves, *_: moves),
    "ease_knees": (foot_lock, lambda moved, moves, *_: moves),
    "turn_up": (foot_lock, lambda motion, *_: np.tile(NOTHING, (len(motion), 1))),
    "over_floor": (refine, lambda source, moved: moved),
    "_risen": (over_floor, lambda moved, *_: moved),
    "bent_up": (over_floor, lambda moved, *_: np.tile(NOTHING, (len(moved), 1))),
    "sway_hips": (refine, lambda source, moved: moved),
    "beyond_feet": (hip_sway, lambda motion, _: np.zeros(len(motion))),
    "continued": (spark_sim.retargeting, lambda source: (source, slice(0, len(source)))),
    "way_taken_out": (spark_sim.retargeting, lambda source: None),
}
HEADS = (
    *("MSE, 1e-6", "root-relative", "toes", "knees off"),
    *("rigs: implausible %", "sunk %", "skating %", "wrench %"),
    *("odd: implausible %", "sunk %", "skating %", "wrench %", "knees snap"),
)


def of_pairs(folder: Path) -> Callable[[], list[str]]:
    """MSE, root-relative MSE, the speed of standing toes over the truth's, and knees [degrees]."""
    shared = shared_motions(folder)
    clips = {path: read(path) for paths in shared.values() for path in paths}
    pairs = [pair for paths in shared.values() for pair in permutations(paths, 2)]
    pairs = [(a, b) for a, b in pairs if same_motion(clips[a][0], clips[b][0])][::STEP]

    def cells() -> list[str]:
        scores, feet, knees = defaultdict(list), [], []
        for a, b in pairs:
            source, (known, truth) = clips[a][0], clips[b]
            moved = METHODS["`retarget`"](source, truth.rig)
            score, of_feet = compare(moved, truth)
            scores[b.parent.name].append(score)
            feet.append(of_feet)
            frames = min(len(moved), len(known))
            bends = [legs(each)[0][:frames] for each in (moved, known)]
            knees.append(np.abs(bends[0] - bends[1]).mean())
        mean = mean_score(scores)
        toes = np.nanmean([f.toes for f in feet]) / np.nanmean([f.truth_toes for f in feet])
        errors = [f"{1e6 * error:.1f}" for error in (mean.mse, mean.relative_mse)]
        return [*errors, f"{toes:.2f}", f"{np.mean(knees):.2f}°"]

    return cells


def of_reports(pairs: Sequence[tuple[Clip, Clip]], *, knees: bool) -> list[str]:
    """Implausible frames and three of their parts, and of 10,000 frames and `knees` how many
    snap."""
    shares, snaps = [], []
    for source, target in pairs:
        moved = spark_sim.retarget(source, target)
        shares.append(measured(spark_sim.report(moved, source=source).clip)[[0, 1, 3, 4]])
        snaps.append(1e4 * snapping(moved.canonical) if knees else 0.0)
    cells = [f"{share:.1f}" for share in np.mean(shares, axis=0)]
    return [*cells, f"{np.mean(snaps):.0f}"] if knees else cells


def snapping(motion: CanonicalMotion) -> float:
    """The share of frames and knees that snap."""
    turns = np.diff(legs(motion)[0], 2, axis=0) / (60 * motion.frame_time) ** 2
    return float((np.abs(turns) > SNAP).mean())


def clips_of(data: Path, patterns: Sequence[str]) -> list[Clip]:
    clips = [spark_sim.load(p) for pattern in patterns for p in sorted(data.glob(pattern))]
    return [clip for clip in clips if isinstance(clip, Clip)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--only", nargs="+", choices=WITHOUT, default=[*WITHOUT])
    args = parser.parse_args()
    recorded = of_pairs(args.data / "mixamo_pairs")
    rigs = [*permutations(clips_of(args.data, RIGS), 2)][::PAIRS]
    odd = [*product(clips_of(args.data, ACROBATS), clips_of(args.data, ODD))]
    sets = [[(middle(a, SECONDS), b) for a, b in pairs] for pairs in (rigs, odd)]
    print(f"| | {' | '.join(HEADS)} |\n|---|{'---|' * len(HEADS)}")
    for name in ("", *args.only):
        module, nothing = WITHOUT.get(name, (foot_lock, None))
        with patch.object(module, name, nothing) if name else nullcontext():
            cells = [
                *recorded(),
                *of_reports(sets[0], knees=False),
                *of_reports(sets[1], knees=True),
            ]
        print(
            f"| {f'no `{name}`' if name else 'as it is'} | {' | '.join(cells)} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
