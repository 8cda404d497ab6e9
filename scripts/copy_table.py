"""How plausible motions are before and after they are put on other bodies, as Markdown.

Usage: python scripts/copy_table.py FOLDER TARGET... (a folder of BVH sources, BVH targets)
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np

import spark_sim
from sim.report import ClipMetrics
from sim.report.names import FLAGS, LABELS

WAYS: dict[str, dict[str, Any]] = {
    "`copy` alone": {"method": "copy", "refine": False},
    "`copy`, feet held": {"method": "copy"},
    "`spark`, feet not held": {"refine": False},
    "`spark`": {},
}


def row(name: str, clips: list[ClipMetrics]) -> str:
    """Shares over the frames of all clips together."""
    flags = [np.concatenate([clip.flags[name] for clip in clips]) for name in FLAGS]
    shares = [np.any(flags, axis=0), *flags]
    return f"| {name} | " + " | ".join(f"{100 * share.mean():.1f} %" for share in shares) + " |"


def main(folder: str, *targets: str) -> None:
    sources = [spark_sim.load(path) for path in sorted(Path(folder).glob("*.bvh"))]
    frames = sum(len(source.motion) for source in sources)
    print(f"{len(sources)} clips, {frames} frames\n")
    heads = " | ".join(LABELS[name] for name in FLAGS)
    print(f"| | implausible | {heads} |\n|---|{'---|' * (len(FLAGS) + 1)}")
    print(row("the source itself", [spark_sim.report(s).clip for s in sources]))
    for target in map(spark_sim.load, targets):
        for name, how in WAYS.items():
            results = []
            for source in sources:
                moved = spark_sim.retarget(source, target, **how)
                results.append(spark_sim.report(moved, source=source).clip)
            print(row(f"{name}, onto {target.name}", results))


if __name__ == "__main__":
    main(*sys.argv[1:])
