"""Which clips `play --physics` keeps up, on any robot.

    python -m scripts.balance_bench DATA --robots unitree_g1 [--clips 'cmu_asf/cmu_02_*.bvh']

docs/policies.md has its figures, and those of `scripts/balance_qp.py` over the same clips.
"""

import argparse
import time
from pathlib import Path

import numpy as np

from robots.model.known import known
from robots.model.morphology import Morphology
from robots.solver.solve import retarget
from scripts.robot_bars import FOLDERS, plausible_clips
from sim.physics.summary import summarize
from sim.physics.tracking import track
from sim.report.assess import assess
from sim.trajectory import Subject
from spark.transfer.canonical import CanonicalMotion


def robots_and_clips(doc: str) -> tuple[dict[str, Morphology], dict[str, CanonicalMotion]]:
    """What the command line of a program with this docstring names: robots, and clips whose source
    is itself plausible."""
    parser = argparse.ArgumentParser(description=doc.splitlines()[0])
    parser.add_argument("data", type=Path, help="the folder with the recordings")
    parser.add_argument("--robots", nargs="+", default=["unitree_g1"])
    parser.add_argument("--clips", nargs="+", default=FOLDERS)
    parser.add_argument("--seconds", type=float, default=8.0, help="of each clip, at most")
    args = parser.parse_args()
    clips = plausible_clips(args.data, args.clips, args.seconds)
    return {name: known(name) for name in args.robots}, clips


def main() -> None:
    robots, clips = robots_and_clips(__doc__)
    for name, robot in robots.items():
        shares, errors = [], []
        for stem, source in clips.items():
            result = retarget(source, robot)
            needed = assess(Subject(result.motion, robot.rig, result.body)).clip.torque_by_joint
            start = time.process_time()
            tracked = track(
                result.body,
                result.frame_time,
                height=robot.rig.standing_height,
                balance=True,
                torques=needed,
            )
            took = time.process_time() - start
            found = summarize(tracked)
            whole = (len(result) - 1) * result.frame_time
            shares.append(found["upright_s"] / whole if found["verdict"] == "falls" else 1.0)
            errors.append(found["error"]["mpjpe_cm"])
            print(
                f"{name} {stem}: {shares[-1] * whole:.2f} s of {whole:.2f} s, {errors[-1]:.1f} cm "
                f"off, {len(tracked.taken_back)} falls taken back ({took / whole:.1f} s a second)",
                flush=True,
            )
        print(
            f"{name}: {100 * np.mean(np.array(shares) >= 1):.0f} % of {len(shares)} clips, "
            f"{100 * np.mean(shares):.0f} % of their time, {np.mean(errors):.1f} cm off in the mean"
        )


if __name__ == "__main__":
    main()
