"""Measure retargeting of recordings as people have them: clean clips spoilt, judged by clean ones.

    python scripts/recordings_bench.py --data DIR --robots unitree_g1 [--method stream] [--fps 60]

A spoilt clip is retargeted, and the robot's motion judged (`robots.metrics`) by the clip as it was.
Lengths are of an adult; noise and sway are RMS an axis.
"""

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Float

from robots.metrics import measure
from robots.model.known import known
from robots.solver.solve import retarget
from scripts.corruptions import jittering, resampled
from scripts.robot_bars import cells, follow, mean_of, plausible_clips
from spark.motion import Motion
from spark.resample import motion_at
from spark.rig.contacts import ADULT_HEIGHT
from spark.rig.rig import Rig
from spark.transfer.canonical import CanonicalMotion, from_canonical, to_canonical

CLIPS = (
    "cmu_asf/cmu_02_0[1-5].bvh",
    "cmu_dance/cmu_05_09.bvh",
    "reactidle/00[04]*.bvh",
    "animateddrawings/zombie.bvh",
    "animateddrawings/jumping.bvh",
)
COLUMNS = (
    "implausible %",
    "skating %",
    "wrench %",
    "float %",
    "contacts F1",
    "in air %",
    "skate cm/s",
    "hips acc.",
    "clearance",
    "limbs",
    "drift cm",
)
Spoiler = Callable[[Motion, Rig, np.random.Generator], Motion]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--robots", nargs="+", required=True)
    parser.add_argument("--clips", nargs="+", default=CLIPS)
    parser.add_argument("--seconds", type=float, default=8.0, help="of each clip, at most")
    parser.add_argument("--fps", type=float, default=30.0)
    parser.add_argument("--method", choices=("solve", "stream"), default="solve")
    args = parser.parse_args()
    method = {"solve": retarget, "stream": follow}[args.method]
    clips = plausible_clips(args.data, args.clips, args.seconds).values()
    clean = [at_rate(clip, args.fps) for clip in clips]
    for name in args.robots:
        robot = known(name)
        print(f"\n| {Path(name).stem}, {len(clean)} clips | {' | '.join(COLUMNS)} |")
        print("|---|" + "---|" * len(COLUMNS))
        for kind, spoil in KINDS.items():
            rows = []
            for k, source in enumerate(clean):
                motion, rig = from_canonical(source), source.rig
                spoilt = to_canonical(spoil(motion, rig, np.random.default_rng(k)), rig)
                rows.append(measure(motion, rig, method(spoilt, robot)))
            print(f"| {kind} | {cells(mean_of(rows), COLUMNS)} |", flush=True)


def at_rate(source: CanonicalMotion, fps: float) -> CanonicalMotion:
    motion, rig = from_canonical(source), source.rig
    return to_canonical(resampled(motion, rig, np.random.default_rng(0), fps=fps), rig)


def noisy(
    motion: Motion, rig: Rig, rng: np.random.Generator, *, root_cm: float, degrees: float
) -> Motion:
    """As video and trackers estimate it frame by frame: the root, and every joint's rotation."""
    shaken = jittering(motion, rig, rng, degrees=degrees)
    return moved(shaken, rig, 0.01 * root_cm * rng.normal(size=motion.root_pos.shape))


def swaying(motion: Motion, rig: Rig, rng: np.random.Generator, *, cm: float) -> Motion:
    """As video has it whose depth is unsure: the body drifts and bobs at 0.5 to 2 Hz."""
    times = np.arange(len(motion)) * motion.frame_time
    phases = 2 * np.pi * rng.random((6, 3))
    turns = 2 * np.pi * np.geomspace(0.5, 2.0, 6)[:, None, None] * times[:, None]
    return moved(motion, rig, 0.01 * cm * np.sin(turns + phases[:, None]).sum(0) / np.sqrt(3))


def drifting(motion: Motion, rig: Rig, rng: np.random.Generator, *, climb_cm: float) -> Motion:
    """As inertial suits have it: 5 cm a second along the floor, which climbs in 10 s."""
    times, angle = np.arange(len(motion))[:, None] * motion.frame_time, 2 * np.pi * rng.random()
    way = np.array([0.05 * np.cos(angle), 0.05 * np.sin(angle), 0.001 * climb_cm])
    return moved(motion, rig, times * way)


def dropped(motion: Motion, rig: Rig, rng: np.random.Generator) -> Motion:
    """2 to 5 frames out of every 10 to 30 are the last one that was seen."""
    seen, start = np.arange(len(motion)), 5
    while start < len(motion):
        count = int(rng.integers(2, 6))
        seen[start : start + count] = start - 1
        start += count + int(rng.integers(8, 25))
    return motion_at(motion, seen.astype(np.float64), motion.frame_time)


def moved(motion: Motion, rig: Rig, path: Float[np.ndarray, "T 3"]) -> Motion:
    """The whole body displaced by a path [m, of an adult]."""
    source = to_canonical(motion, rig)
    hips = source.hips + path * rig.standing_height / ADULT_HEIGHT
    return from_canonical(CanonicalMotion(rig, source.frame_time, source.rotations, hips))


KINDS: dict[str, Spoiler] = {
    "clean": lambda motion, rig, rng: motion,
    "noise 0.2 cm, 0.3°": partial(noisy, root_cm=0.2, degrees=0.3),
    "noise 0.5 cm, 1°": partial(noisy, root_cm=0.5, degrees=1.0),
    "noise 1 cm, 2°": partial(noisy, root_cm=1.0, degrees=2.0),
    "noise 2 cm, 4°": partial(noisy, root_cm=2.0, degrees=4.0),
    "root 2 cm": partial(noisy, root_cm=2.0, degrees=0.0),
    "sway 1 cm": partial(swaying, cm=1.0),
    "sway 3 cm": partial(swaying, cm=3.0),
    "drift, floor climbs 5 cm": partial(drifting, climb_cm=5.0),
    "drift, floor sinks 5 cm": partial(drifting, climb_cm=-5.0),
    "dropped frames": dropped,
}


if __name__ == "__main__":
    main()
