"""How much knees bend on other bodies where the source's leg is straight.

Usage: python scripts/knees_bench.py SECONDS SOURCE... onto TARGET...
(files of characters; at most so many seconds of the middle of each source)

Prints Markdown: of frames and legs whose knee the source bends by less than 25 degrees, the median
and the 95th percentile of how much more the target's bends [degrees], and the share that bends by
20 more; of all, the mean difference [degrees], and the share that is stretched to the end where the
source's is not. Means over the pairs, then the worst targets.
"""

import sys
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np
from jaxtyping import Float

import spark_sim
from scripts.rigs_bench import middle
from spark.rig.rig import Rig
from spark.rig.roles import LIMBS, Group
from spark.transfer.analytic import transfer
from spark.transfer.canonical import CanonicalMotion, canonical_positions
from spark.transfer.foot_lock import lock_feet
from spark.transfer.own_soles import fit_body
from spark.transfer.refine import refined
from spark_sim.clips import Clip

STRAIGHT, MORE = 25.0, 20.0  # [degrees]
STRETCHED, SHORT = 0.9985, 0.99  # [legs] from the hip to the ankle
FEW = 10  # frames and legs: no fewer straight ones are measured
WORST = 8  # targets that are named
LEGS = (Group.LEFT_LEG, Group.RIGHT_LEG)


def legs(motion: CanonicalMotion) -> tuple[Float[np.ndarray, "T 2"], Float[np.ndarray, "T 2"]]:
    """How far the knees are bent [degrees], and the ankles are from the hip joints [legs]."""
    roles = motion.rig.roles
    joints = [roles.require(role) for group in LEGS for role in LIMBS[group][:3]]
    at = canonical_positions(motion, joints).reshape(len(motion), 2, 3, 3)
    thigh, shank = np.moveaxis(np.diff(at, axis=2), 2, 0)
    a, b = np.linalg.norm(thigh, axis=-1), np.linalg.norm(shank, axis=-1)
    bend = np.arccos(np.clip((thigh * shank).sum(-1) / (a * b), -1.0, 1.0))
    return np.degrees(bend), np.linalg.norm(at[:, :, 2] - at[:, :, 0], axis=-1) / (a + b)


def compared(source: CanonicalMotion, moved: CanonicalMotion) -> Float[np.ndarray, "5"]:
    """The five columns; NaN in the first three where the source's legs are never straight."""
    (bend, reach), (own_bend, own_reach) = legs(source), legs(moved)
    more = own_bend - bend
    straight = more[bend < STRAIGHT]
    first = [np.nan] * 3
    if len(straight) > FEW:
        high = 100 * (straight > MORE).mean()
        first = [float(np.median(straight)), float(np.percentile(straight, 95)), float(high)]
    stretched = (own_reach > STRETCHED) & (reach < SHORT)
    return np.array([*first, np.abs(more).mean(), 100 * stretched.mean()])


def main(seconds: str, *paths: str) -> None:
    split = paths.index("onto")
    sources = [spark_sim.load(path) for path in paths[:split]]
    methods: dict[str, Callable[[CanonicalMotion, Rig], CanonicalMotion]] = {
        "copy, feet held": lambda s, rig: lock_feet(s, transfer(s, rig)),
        "`retarget`": lambda s, rig: refined(s, fit_body(s, transfer(s, rig))),
    }
    heads = ("median", "95th percentile", "20° more", "all, mean", "stretched")
    print(f"| | {' | '.join(heads)} |\n|{'---|' * (len(heads) + 1)}")
    for name, method in methods.items():
        found = defaultdict(list)
        for path in paths[split + 1 :]:
            rig = spark_sim.load(path).rig
            for clip in sources:
                assert isinstance(clip, Clip)
                source = middle(clip, float(seconds)).canonical
                found["/".join(Path(path).parts[-2:])].append(compared(source, method(source, rig)))
        every = np.nanmean([row for rows in found.values() for row in rows], axis=0)
        print(
            f"| {name} | {every[0]:.1f}° | {every[1]:.1f}° | {every[2]:.1f} % | {every[3]:.1f}° | "
            f"{every[4]:.1f} % |"
        )
    means = {target: np.nanmean(rows, axis=0) for target, rows in found.items()}
    print("\nWorst targets of `retarget`, 20° more:\n")
    for target, mean in sorted(means.items(), key=lambda item: -item[1][2])[:WORST]:
        print(f"- {target}: {mean[2]:.1f} %, median {mean[0]:.1f}°, all {mean[3]:.1f}°")


if __name__ == "__main__":
    main(*sys.argv[1:])
