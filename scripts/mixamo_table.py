"""How near copied motions come to Mixamo's own retargeting, as Markdown.

Usage: python scripts/mixamo_table.py FOLDER (one folder a character; the same file name in two of
them is the same motion)
"""

import sys
from collections import defaultdict
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import spark_sim
from spark.canonical import CanonicalMotion, to_canonical
from spark.clips import FRAME_TIME, at_frame_time
from spark.metrics import Score, mean_score, score
from spark.refine import refine
from spark.transfer import transfer

COLUMNS = (
    "MSE",
    "root-relative MSE",
    "MPJPE, % of height",
    "standing feet, heights/s",
    "jerk, heights/s³",
)


def read(folder: Path) -> dict[str, dict[str, CanonicalMotion]]:
    """Clips by motion and character, at 30 fps."""
    clips: dict[str, dict[str, CanonicalMotion]] = defaultdict(dict)
    for path in sorted(p for p in folder.glob("*/*") if p.suffix.lower() in (".fbx", ".bvh")):
        clip = spark_sim.load(path)
        canonical = to_canonical(clip.motion, clip.rig)
        clips[path.stem][path.parent.name] = at_frame_time(canonical, FRAME_TIME)
    return clips


def cut(clip: CanonicalMotion, frames: int) -> CanonicalMotion:
    return replace(clip, rotations=clip.rotations[:frames], hips=clip.hips[:frames])


def row(name: str, s: Score) -> str:
    return (
        f"| {name} | {s.mse:.6f} | {s.relative_mse:.6f} | {s.mpjpe:.2f} "
        f"| {s.foot_speed:.4f} ({s.truth_foot_speed:.4f}) | {s.jerk:.0f} ({s.truth_jerk:.0f}) |"
    )


def main(folder: str) -> None:
    copied: dict[str, list[Score]] = defaultdict(list)
    held: dict[str, list[Score]] = defaultdict(list)
    motions = {name: clips for name, clips in read(Path(folder)).items() if len(clips) > 1}
    for clips in motions.values():
        for name, target in permutations(clips, 2):
            frames = min(len(clips[name]), len(clips[target]))
            source, truth = cut(clips[name], frames), cut(clips[target], frames)
            moved = transfer(source, truth.rig)
            copied[target].append(score(moved, truth))
            held[target].append(score(refine(source, moved), truth))
    pairs = sum(map(len, copied.values()))
    print(f"{len(motions)} motions, {len(copied)} characters, {pairs} pairs\n")
    print(f"| method | {' | '.join(COLUMNS)} |\n|---|{'---|' * len(COLUMNS)}")
    print(row("`copy`", mean_score(copied)))
    print(row("`copy`, feet held", mean_score(held)))
    for target in sorted(copied):
        print(row(f"`copy` onto {target}", mean_score({target: copied[target]})))


if __name__ == "__main__":
    main(*sys.argv[1:])
