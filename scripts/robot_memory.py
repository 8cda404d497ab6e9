"""Measure the memory at its peak, and the speed, of retargeting onto a robot in its own process.

python scripts/robot_memory.py --frames 20000 [--robot unitree_g1] [--clip dance.bvh]

The motion is the made walk at 60 fps, or a clip at 30 fps, to and fro, as long as asked.
"""

import argparse
import resource
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from robots.model.known import known
from robots.solver.solve import retarget
from spark.demo.sample import sample_motion, sample_rig
from spark.io.recording import read_recording
from spark.rig.rig import understand
from spark.transfer.canonical import CanonicalMotion, at_frame_time, to_canonical

WARM_UP = 100  # frames in which what is found once for a robot is found


def pacing(frames: int, clip: Path | None = None) -> CanonicalMotion:
    """A clip at 30 fps, or the made walk at 60, to and fro, as long as asked."""
    if clip is None:
        rig = sample_rig("walker")
        source = to_canonical(sample_motion("walk", rig, 60.0), rig)
    else:
        motion = read_recording(clip).motion
        source = at_frame_time(to_canonical(motion, understand(motion)), 1 / 30)
    last = len(source) - 1
    again = last - np.abs(np.arange(frames) % (2 * last) - last)
    return replace(source, rotations=source.rotations[again], hips=source.hips[again])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, required=True, help="0: the process without any")
    parser.add_argument("--robot", default="unitree_g1")
    parser.add_argument("--clip", type=Path)
    args = parser.parse_args()
    robot, told = known(args.robot), ""
    if args.frames:
        source = pacing(args.frames, args.clip)
        retarget(source.frames(0, WARM_UP), robot)
        began = time.process_time()
        retarget(source, robot)
        told = f", {args.frames / (time.process_time() - began):.0f} for a second of one core"
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    print(f"{args.frames} frames{told}: {peak:.2f} GB at the peak")


if __name__ == "__main__":
    main()
