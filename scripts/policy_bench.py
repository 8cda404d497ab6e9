"""How well a policy follows what is retargeted onto its robot, in simulation.

python -m scripts.policy_bench POLICY SPEC FILE... [--robot unitree_g1] [--seconds 20] [--seeds 3]

Prints Markdown: for each file the falls of each run and the means of `spark-sim play --physics
--policy`, then those of all runs, by time.
"""

import argparse
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

import spark_sim

COLUMNS = ("body_error_cm", "joint_error_deg", "root_speed_error_m_s", "torque_rms_share")


def row(name: str, found: list[dict[str, Any]], falls: str) -> str:
    """The means of some motions, by how long they last."""
    seconds = [each["duration_s"] for each in found]
    means = [np.average([each[c] for each in found], weights=seconds) for c in COLUMNS]
    return f"| {name} | {sum(seconds):.1f} | {falls} | {' | '.join(f'{m:.3f}' for m in means)} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("policy", type=Path)
    parser.add_argument("spec", type=Path)
    parser.add_argument("files", type=Path, nargs="+")
    parser.add_argument("--robot", default="unitree_g1")
    parser.add_argument("--seconds", type=float, default=20.0, help="of each file, at most")
    parser.add_argument("--seeds", type=int, default=3)
    args = parser.parse_args()
    print("| | s | falls | bodies, cm | joints, ° | root, m/s | torque |", flush=True)
    print("|---|---|---|---|---|---|---|")
    clips = (spark_sim.load(path).part(end=args.seconds) for path in args.files)
    made = ((clip.name, spark_sim.retarget(clip, args.robot)) for clip in clips)
    follow(made, args.policy, args.spec, args.seeds)


def follow(
    motions: Iterable[tuple[str, spark_sim.RobotClip]], policy: Path, spec: Path, seeds: int = 3
) -> None:
    """Print a row of each motion that a policy follows, and of all."""
    found = []
    for name, motion in motions:
        told = spark_sim.follow(motion, policy, spec, seeds=seeds).json()
        found.append(told)
        falls = " ".join(str(seed["falls"]) for seed in told["seeds"])
        print(row(name, [told], falls), flush=True)
    sound = np.mean([seed["falls"] == 0 for told in found for seed in told["seeds"]])
    print(row(f"all {len(found)}", found, f"none in {100 * sound:.1f} % of the runs"))


if __name__ == "__main__":
    main()
