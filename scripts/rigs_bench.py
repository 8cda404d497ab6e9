"""How believable motions between rigs of all kinds are, beside those of copied rotations.

Usage: python scripts/rigs_bench.py SECONDS FILE...
(files of characters; at most so many seconds of the middle of each go onto the rigs of all others)

Prints Markdown, as `spark-sim report --source` measures it: the mean share of implausible frames
and its parts, jerk, and in how many pairs `retarget` has half a point more, or less, than
`--method copy`; feet are held in both. Then the worst pairs.
"""

import sys
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
from jaxtyping import Float

import spark_sim
from sim.report import Report
from sim.report.clip_metrics import ClipMetrics
from sim.report.names import FLAGS
from spark.errors import SkeletonError
from spark_sim.clips import Clip

ROWS = ("source", "copy", "retarget")
POINT, FEW = 0.5, 2  # a pair is worse by more than so many points, and by more than so many frames
WORST = 12  # pairs that are named


def middle(clip: Clip, seconds: float) -> Clip:
    """So many seconds of the clip's middle, on the rig of the whole."""
    frames = len(clip.motion)
    size = min(frames, max(1, round(seconds / clip.motion.frame_time)))
    start = (frames - size) // 2
    motion = clip.motion.picked(slice(start, start + size))
    return replace(clip, recording=replace(clip.recording, motion=motion), given_rig=clip.rig)


def measured(clip: ClipMetrics) -> Float[np.ndarray, "6"]:
    """Implausible frames and their parts [%], and jerk [rad/s³]."""
    shares = [clip.implausible_share, *(clip.shares[flag] for flag in FLAGS)]
    return np.array([*(100 * share for share in shares), np.sqrt((clip.joint_jerk**2).mean())])


def main(seconds: str, *paths: str) -> None:
    whole: dict[str, Clip] = {}
    sources: dict[str, Clip] = {}
    for path in paths:
        clip = spark_sim.load(path)
        assert isinstance(clip, Clip), f"{path}: a robot's motion, expected a character's"
        try:
            name = "/".join(Path(path).parts[-2:])
            sources[name], whole[name] = middle(clip, float(seconds)), clip
        except SkeletonError as error:
            print(error, file=sys.stderr)
    found: dict[tuple[str, str], Float[np.ndarray, "3 6"]] = {}
    more: dict[tuple[str, str], int] = {}  # frames that are implausible, where they count
    for a, b in permutations(whole, 2):
        source = sources[a]
        copied, moved = (
            spark_sim.report(spark_sim.retarget(source, whole[b], method=method), source=source)
            for method in ("copy", "spark")
        )
        found[a, b] = rows_of(copied, moved)
        points = found[a, b][2, 0] - found[a, b][1, 0]
        frames = round(points / 100 * len(source.motion))
        more[a, b] = frames if abs(frames) > FEW and abs(points) > POINT else 0
    worse, better = ([abs(n) for n in more.values() if n * sign > 0] for sign in (1, -1))
    names = ["implausible", *FLAGS]
    print(
        f"{len(found)} pairs: {len(worse)} worse, by {sum(worse)} frames, {len(better)} better, by "
        f"{sum(better)}\n"
    )
    print(f"| % of the frames | {' | '.join(names)} | jerk |\n|{'---|' * (len(names) + 2)}")
    for name, mean in zip(ROWS, np.mean([*found.values()], axis=0), strict=True):
        print(f"| {name} | {' | '.join(f'{x:.2f}' for x in mean[:-1])} | {mean[-1]:.0f} |")
    print("\nWorst pairs, copy and retarget (source):\n")
    for a, b in sorted(more, key=lambda pair: -more[pair])[:WORST]:
        shares = found[a, b][:, 0]
        print(f"- {a} onto {b}: {shares[1]:.1f}, {shares[2]:.1f} ({shares[0]:.1f}), {more[a, b]:+}")


def rows_of(copied: Report, moved: Report) -> Float[np.ndarray, "3 6"]:
    """The measures of `ROWS`."""
    assert copied.source is not None
    return np.stack([measured(each) for each in (copied.source, copied.clip, moved.clip)])


if __name__ == "__main__":
    main(*sys.argv[1:])
