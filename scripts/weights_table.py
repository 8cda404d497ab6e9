"""What each weight of the robots' solver does: a table of bars, with the weight 30 % down and up.

    python -m scripts.weights_table --data DIR [--robot unitree_g1] [--seconds 8]

Constants of `robots.solver.weights` are scaled one at a time, everywhere in the solver, and the
same clips are solved again. A figure is the mean over the clips.
"""

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from robots.metrics import RobotMetrics
from robots.model.known import known
from robots.solver import weights
from scripts.robot_bars import cells, clip, mean_solved

CLIPS = ("cmu_asf/cmu_02_08.bvh", "cmu_dance/cmu_05_02.bvh", "animateddrawings/jumping_jacks.bvh")
SHOWN = (
    "implausible %",
    "skating %",
    "wrench %",
    "clearance",
    "CoM acc.",
    "in air %",
    "skate cm/s",
    "limbs",
    "rad/s",
    "jerk",
)
CHANGES = (0.7, 1.3)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--robot", default="unitree_g1")
    parser.add_argument("--clips", nargs="+", default=CLIPS)
    parser.add_argument("--seconds", type=float, default=8.0, help="of each clip, at most")
    args = parser.parse_args()
    robot = known(args.robot)
    clips = [clip(args.data / path, args.seconds) for path in args.clips]
    print(f"| {args.robot} | {' | '.join(SHOWN)} |\n|---|{'---|' * len(SHOWN)}")
    print(row("as it is", mean_solved(clips, robot)), flush=True)
    for name in sorted(vars(weights)):
        if name.isupper():
            for change in CHANGES:
                with scaled(name, change):
                    print(row(f"`{name}` x {change}", mean_solved(clips, robot)), flush=True)


def row(label: str, metrics: RobotMetrics) -> str:
    return f"| {label} | {cells(metrics, SHOWN)} |"


@contextmanager
def scaled(name: str, factor: float) -> Iterator[None]:
    """With a weight scaled in every module of the solver that has taken it."""
    value = getattr(weights, name)
    new = {k: factor * v for k, v in value.items()} if isinstance(value, dict) else factor * value
    holders = [m for n, m in sys.modules.items() if n.startswith("robots") and hasattr(m, name)]
    for module in holders:
        setattr(module, name, new)
    try:
        yield
    finally:
        for module in holders:
            setattr(module, name, value)


if __name__ == "__main__":
    main()
