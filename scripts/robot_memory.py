"""Measure the memory at its peak, and the speed, of retargeting onto a robot in its own process.

python scripts/robot_memory.py --frames 20000 [--robot unitree_g1]
"""

import argparse
import resource
import time

import numpy as np

from robots.model.known import known
from robots.solver.solve import retarget
from spark.demo.sample import sample_motion, sample_rig
from spark.motion import Motion
from spark.transfer.canonical import CanonicalMotion, to_canonical

WARM_UP = 100  # frames in which what is found once for a robot is found


def pacing(frames: int) -> CanonicalMotion:
    """The made walk at 60 fps, to and fro, as long as asked."""
    rig = sample_rig("walker")
    walk = sample_motion("walk", rig, 60.0)
    last = len(walk) - 1
    again = last - np.abs(np.arange(frames) % (2 * last) - last)
    motion = Motion(walk.skeleton, walk.frame_time, walk.root_pos[again], walk.rotations[again])
    return to_canonical(motion, rig)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, required=True, help="0: the process without any")
    parser.add_argument("--robot", default="unitree_g1")
    args = parser.parse_args()
    robot, told = known(args.robot), ""
    if args.frames:
        source = pacing(args.frames)
        retarget(source.frames(0, WARM_UP), robot)
        began = time.process_time()
        retarget(source, robot)
        told = f", {args.frames / (time.process_time() - began):.0f} for a second of one core"
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"{args.frames} frames{told}: {peak:.2f} GB at the peak")


if __name__ == "__main__":
    main()
