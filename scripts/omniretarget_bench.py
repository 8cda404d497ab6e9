"""OmniRetarget and ours on the same clips, 30 frames a second, on a Unitree G1.

    python -m scripts.omniretarget_bench write OUT FILE...
    python -m scripts.omniretarget_bench measure OUT [--follow POLICY SPEC]

`write` makes a BVH of each recording and, beside it, the positions of its joints that OmniRetarget
(`holosoma-retargeting` on PyPI, with mujoco 3.3) takes for SMPL-X's:

    python examples/robot_retarget.py --data_path OUT --task-type robot_only --data_format smplx \\
      --task-config.ground-range -10 10 --save_dir OUT/theirs --task-name NAME

`measure` prints the bars of both, for the clips that OmniRetarget has made, and with a policy how
well that follows both in simulation.
"""

import argparse
from pathlib import Path
from typing import Final

import numpy as np

import spark_sim
from robots.metrics import RobotMetrics, measure
from scripts.policy_bench import follow
from scripts.robot_bars import cells, mean_of, misses
from spark.kinematics import forward
from spark.rig.roles import Role

FPS = 30
ROBOT: Final = "unitree_g1"
TITLES = (
    *("implausible %", "(source)", "penetr. %", "float %", "skating %", "wrench %", "clearance"),
    *("hips acc.", "CoM acc.", "limb acc.", "contacts F1", "heading", "drift cm", "limbs", "jerk"),
    *("limit %", "self %"),
)
_STATURE = 1 / 0.53  # of OmniRetarget's people, in hip heights: it scales by it
# SMPL-X's joints in its order. It reads the pelvis and those of the limbs alone.
_JOINTS = (
    *(Role.PELVIS, Role.LEFT_UPPER_LEG, Role.RIGHT_UPPER_LEG, None),
    *(Role.LEFT_LOWER_LEG, Role.RIGHT_LOWER_LEG, None, Role.LEFT_FOOT, Role.RIGHT_FOOT, None),
    *(Role.LEFT_TOE, Role.RIGHT_TOE, None, None, None, None),
    *(Role.LEFT_UPPER_ARM, Role.RIGHT_UPPER_ARM, Role.LEFT_FOREARM, Role.RIGHT_FOREARM),
    *(Role.LEFT_HAND, Role.RIGHT_HAND),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("step", choices=("write", "measure"))
    parser.add_argument("out", type=Path)
    parser.add_argument("files", type=Path, nargs="*", help="what is written")
    parser.add_argument("--seconds", type=float, default=8.0, help="of each file, at most")
    parser.add_argument("--follow", nargs=2, type=Path, metavar=("POLICY", "SPEC"))
    args = parser.parse_args()
    if args.step == "write":
        args.out.mkdir(parents=True, exist_ok=True)
        for path in args.files:
            write(path, args.out, args.seconds)
        return
    clips = [spark_sim.load(args.out / f"{path.stem}.bvh") for path in results(args.out)]
    theirs = [spark_sim.load(path, robot=ROBOT) for path in results(args.out)]
    ours = [spark_sim.retarget(clip, ROBOT) for clip in clips]
    print(f"| | {' | '.join(TITLES)} |\n|---|{'---|' * len(TITLES)}")
    both = {"OmniRetarget": theirs, "ours": ours}
    for name, made in both.items():
        compare(name, clips, made)
    if args.follow:
        for name, made in both.items():
            names = [f"{name}: {clip.name}" for clip in clips]
            follow(zip(names, made, strict=True), *args.follow)


def results(out: Path) -> list[Path]:
    """What OmniRetarget has made."""
    return sorted((out / "theirs").glob("*.npz"))


def write(path: Path, out: Path, seconds: float) -> None:
    """A recording as BVH, and as positions of joints [m] for OmniRetarget."""
    clip = spark_sim.load(path).resampled(FPS).part(end=seconds)
    clip.save(out / f"{path.stem}.bvh", force=True)
    positions, _ = forward(clip.motion)
    joints = [clip.rig.hips if role is None else clip.rig.roles.require(role) for role in _JOINTS]
    height = _STATURE * clip.rig.hip_height
    at = out / f"{path.stem}.npz"
    np.savez(at, global_joint_positions=positions[:, joints], height=height)


def compare(name: str, clips: list[spark_sim.Clip], made: list[spark_sim.RobotClip]) -> None:
    """A row of each clip and their means."""
    rows: list[RobotMetrics] = []
    for clip, result in zip(clips, made, strict=True):
        rows.append(measure(clip.motion, clip.rig, result.on_robot))
        print(f"| {name}: {clip.name} | {cells(rows[-1], TITLES)} |", flush=True)
    mean = mean_of(rows)
    print(f"| {name}: mean of {len(rows)} | {cells(mean, TITLES)} |")
    print(f"{name} misses in the mean: {', '.join(misses(mean)) or 'none'}")


if __name__ == "__main__":
    main()
