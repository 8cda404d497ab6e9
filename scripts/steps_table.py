"""What each step of the robots' solver gives: a table of bars, with one step left out at a time.

    python -m scripts.steps_table --data DIR [--robot unitree_h1] [--seconds 8]

The steps are those that `robots.solver.solve` names. A figure is the mean over the clips: dances,
one who picks something up, a referee who rolls his forearm, and three on the ground.
"""

import argparse
from collections.abc import Callable
from pathlib import Path
from unittest.mock import patch

import numpy as np

from robots.model.known import known
from robots.solver import solve
from scripts.robot_bars import cells, clip, mean_solved

CLIPS = (
    "cmu_asf/cmu_02_06.bvh",
    "cmu_dance/cmu_05_04.bvh",
    "cmu_dance/cmu_05_06.bvh",
    "cmu_dance/cmu_05_10.bvh",
    "cmu_expmap/train_basketball_signal_1.bvh",
    "deepmimic/deepmimic_cartwheel.bvh",
    "deepmimic/deepmimic_crawl.bvh",
    "deepmimic/deepmimic_getup_facedown.bvh",
)
SHOWN = (
    "implausible %",
    "skating %",
    "wrench %",
    "clearance",
    "CoM acc.",
    "limb acc.",
    "in air %",
    "rests slide",
    "limbs",
    "trunk",
    "jerk",
    "self %",
)
WITHOUT: dict[str, Callable[..., object]] = {  # what is done in a step's place
    "without_strays": lambda source: (source, ()),
    "less_deep": lambda source, *_: source,
    "limit_speed": lambda robot, q, frame_time: q,
    "leans": lambda *_: False,
    "apart": lambda feet: list(feet),
    "reachable": lambda robot, feet, q: list(feet),
    "unhurried": lambda feet, flight: list(feet),
    "with_dynamics": lambda robot, targets, feet, q: (targets, list(feet)),
    "abrupt": lambda robot, targets, q, block: np.zeros(len(q), dtype=bool),
    "led_back": lambda robot, targets, holds, q, block: q,
    "with_firm_hands": lambda robot, targets: targets,
    "repair": lambda robot, targets, holds, q, block: (q, np.zeros(len(q), dtype=bool)),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--robot", default="unitree_h1")
    parser.add_argument("--clips", nargs="+", default=CLIPS)
    parser.add_argument("--seconds", type=float, default=8.0, help="of each clip, at most")
    args = parser.parse_args()
    robot = known(args.robot)
    clips = [clip(args.data / path, args.seconds) for path in args.clips]
    print(f"| {args.robot} | {' | '.join(SHOWN)} |\n|---|{'---|' * len(SHOWN)}")
    print(f"| as it is | {cells(mean_solved(clips, robot), SHOWN)} |", flush=True)
    for name, nothing in WITHOUT.items():
        with patch.object(solve, name, nothing):
            print(f"| no `{name}` | {cells(mean_solved(clips, robot), SHOWN)} |", flush=True)


if __name__ == "__main__":
    main()
