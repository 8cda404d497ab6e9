"""Methods against recorded pairs, one motion on two characters, each target given as a T-pose.

Usage: python scripts/characters_bench.py FOLDER [STEP] (a folder with one folder a character; with
STEP, every so many of the pairs)

Prints Markdown: a row a method, then its worst characters. *Toes* is the speed of standing toes and
*clearance* the median height of swinging soles, both over the truth's; *sunk* is the share of feet
and frames more than 1 cm under the floor. Lengths and speeds are those of an adult.
"""

import sys
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float

import spark_sim
from spark.evaluation.metrics import Score, mean_score, san_height, score_positions
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.contacts import ADULT_HEIGHT, floor_height, planted_feet, speeds
from spark.rig.feet import sole_positions
from spark.rig.rig import Rig, understand
from spark.rotation import quat_identity, quat_mul
from spark.training.same_motion import same_motion
from spark.transfer.analytic import transfer
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.foot_lock import lock_feet
from spark.transfer.own_soles import fit_body
from spark.transfer.refine import refined

SWING_SPEED, SWING_HEIGHT, MIN_SWINGS = 0.5, 0.02, 30  # [m/s], [m] of a truth's swinging sole
SUNK = 0.01  # [m]
WORST = 6  # characters that are named

METHODS: dict[str, Callable[[CanonicalMotion, Rig], CanonicalMotion]] = {
    "copy": transfer,
    "copy, feet held": lambda s, rig: lock_feet(s, transfer(s, rig)),
    "legs fitted": lambda s, rig: fit_body(s, transfer(s, rig)),
    "legs fitted, feet held": lambda s, rig: lock_feet(s, fit_body(s, transfer(s, rig))),
    "`retarget`": lambda s, rig: refined(s, fit_body(s, transfer(s, rig))),
}


@dataclass(frozen=True, eq=False)
class Truth:
    """A motion as its file has it, on the rig that its T-pose alone tells; `size` is its height
    over an adult's, `clearance` [m] that of its soles."""

    rig: Rig
    positions: Float[np.ndarray, "T J 3"]
    planted: Bool[np.ndarray, "T F"]
    clearance: Float[np.ndarray, "T F"]
    swings: Bool[np.ndarray, "T F"]
    size: float


@dataclass(frozen=True)
class Feet:
    """`toes` [m/s] of standing ones, beside the truth's; NaN where there is nothing to measure."""

    toes: float
    truth_toes: float
    clearance: float
    sunk: float


def read(path: Path) -> tuple[CanonicalMotion, Truth]:
    """The motion as a source, and as the truth of a target."""
    clip = spark_sim.load(path)
    motion = clip.motion
    rest = quat_identity(np.zeros((1, len(motion.skeleton), 1)))
    rig = understand(Motion(motion.skeleton, motion.frame_time, np.zeros((1, 3)), rest))
    positions, world = forward(motion)
    size = rig.standing_height / ADULT_HEIGHT
    soles = _soles(rig, positions, world)
    clearance = soles[..., 2].min(2) - floor_height(rig, positions, world)
    speed = speeds(soles.mean(2), motion.frame_time)
    swings = (speed > SWING_SPEED * size) & (clearance > SWING_HEIGHT * size)
    planted = planted_feet(rig, positions, motion.frame_time)
    return clip.canonical, Truth(rig, positions, planted, clearance, swings, size)


def compare(moved: CanonicalMotion, truth: Truth) -> tuple[Score, Feet]:
    rig, frames = truth.rig, min(len(moved), len(truth.positions))
    own, theirs = canonical_positions(moved)[:frames], truth.positions[:frames]
    score = score_positions(own, theirs, rig, moved.frame_time, san_height(rig))
    world = quat_mul(moved.rotations[:frames], rig.tpose)
    height = _soles(rig, own, world)[..., 2].min(2) - moved.floor_z
    swings, planted = truth.swings[:frames], truth.planted[:frames]
    clearance = float("nan")
    if swings.sum() >= MIN_SWINGS:
        clearance = float(np.median(height[swings]) / np.median(truth.clearance[:frames][swings]))
    toes, true_toes = (
        speeds(p[:, rig.contact_joints], moved.frame_time)[planted].mean() / truth.size
        if planted.any()
        else float("nan")
        for p in (own, theirs)
    )
    sunk = float((height < -SUNK * truth.size).mean())
    return score, Feet(float(toes), float(true_toes), clearance, sunk)


def source_clearance(source: Truth, truth: Truth) -> float:
    """How high the source's own soles pass, for the size, where the truth's swing, over the
    truth's; NaN where it hardly swings."""
    frames = min(len(source.clearance), len(truth.clearance))
    swings = truth.swings[:frames]
    if swings.sum() < MIN_SWINGS:
        return float("nan")
    theirs, own = (float(np.median(t.clearance[:frames][swings])) / t.size for t in (source, truth))
    return theirs / own


def shared_motions(folder: Path) -> dict[str, list[Path]]:
    """The files of each name that is on two characters or more."""
    by_motion: dict[str, list[Path]] = defaultdict(list)
    for path in sorted(folder.glob("[!_]*/*.bvh")):
        by_motion[path.stem].append(path)
    return {name: paths for name, paths in by_motion.items() if len(paths) > 1}


def main(folder: str, step: str = "1") -> None:
    shared = shared_motions(Path(folder))
    clips = {path: read(path) for paths in shared.values() for path in paths}
    pairs = [(a, b) for paths in shared.values() for a in paths for b in paths if a != b]
    named, pairs = len(pairs), [(a, b) for a, b in pairs if same_motion(clips[a][0], clips[b][0])]
    print(f"{len(pairs)} pairs of {named}; the others share a name, but move differently\n")
    pairs = pairs[:: int(step)]
    print("| | MSE | root-relative MSE | toes | clearance (5 to 95 % of pairs) | sunk |")
    print("|---|---|---|---|---|---|")
    worst = []
    for name, method in METHODS.items():
        by_target: dict[str, list[Score]] = defaultdict(list)
        feet = []
        for a, b in pairs:
            source, truth = clips[a][0], clips[b][1]
            score, of_feet = compare(method(source, truth.rig), truth)
            by_target[b.parent.name].append(score)
            feet.append(of_feet)
        worst.append(_worst(name, by_target))
        mean = mean_score(by_target)
        toes = np.nanmean([f.toes for f in feet]) / np.nanmean([f.truth_toes for f in feet])
        print(
            f"| {name} | {mean.mse:.3g} | {mean.relative_mse:.3g} | {toes:.2f} | "
            f"{_spread([f.clearance for f in feet])} | "
            f"{100 * np.mean([f.sunk for f in feet]):.1f} % |"
        )
    of_source = _spread([source_clearance(clips[a][1], clips[b][1]) for a, b in pairs])
    print(f"| the source's own soles, for the size | | | | {of_source} | |")
    print(f"\nWorst characters, MSE (root-relative) in 1e-6:\n\n{chr(10).join(worst)}")


def _worst(name: str, by_target: dict[str, list[Score]]) -> str:
    means = {target: mean_score({target: scores}) for target, scores in by_target.items()}
    first = sorted(means.items(), key=lambda item: -item[1].mse)[:WORST]
    named = (f"{who} {1e6 * s.mse:.0f} ({1e6 * s.relative_mse:.0f})" for who, s in first)
    return f"- {name}: {', '.join(named)}"


def _spread(clearance: list[float]) -> str:
    low, high = np.nanpercentile(clearance, (5, 95))
    return f"{np.nanmedian(clearance):.2f} ({low:.2f} to {high:.2f})"


def _soles(
    rig: Rig, positions: Float[np.ndarray, "T J 3"], world: Float[np.ndarray, "T J 4"]
) -> Float[np.ndarray, "T F P 3"]:
    return np.stack([sole_positions(sole, positions, world) for sole in rig.soles], axis=1)


if __name__ == "__main__":
    main(*sys.argv[1:])
