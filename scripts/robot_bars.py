"""Measure retargeting onto robots: a table of each clip, and the bars that it misses.

    python scripts/robot_bars.py --data DIR --robots unitree_g1 h1.xml [--clips 'cmu_asf/*.bvh' ...]

The bars are those of DESIGN 9, in the mean over the clips whose source is itself plausible in all
but a few frames: others walk over blocks, climb, or have a floor that slopes. `--all` has these,
too.
"""

import argparse
import time
from collections.abc import Iterable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from robots.metrics import RobotMetrics, measure
from robots.model.known import known
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.solver.solve import copy, retarget
from robots.stream.frame_targets import LATENCY, Frame, ground_of
from robots.stream.stream import Stream
from sim.report.assess import assess
from sim.report.thresholds import PLAUSIBILITY
from sim.trajectory import Subject
from spark.io.recording import read_recording
from spark.rig.rig import understand
from spark.transfer.canonical import CanonicalMotion, from_canonical, to_canonical

FOLDERS = ("cmu_asf/*", "animateddrawings/*", "reactidle/*", "cmu_dance/*")
CLEAN = 0.3  # share of implausible frames of a source that the bars are for

CONTACTS = 0.97  # F1 of the feet's contacts, at least

COLUMNS = {  # title: (field, factor, format, the bar: what it must not exceed, given the metrics)
    "implausible %": ("implausible", 100, ".1f", lambda m: m.implausible_source + 0.02),
    "(source)": ("implausible_source", 100, ".1f", None),
    "penetr. %": ("penetration", 100, ".2f", lambda m: 0.002),
    "float %": ("floating", 100, ".2f", lambda m: m.floating_source + 0.005),
    "skating %": ("skating", 100, ".1f", lambda m: m.skating_source + 0.01),
    "wrench %": ("root_wrench", 100, ".1f", lambda m: m.root_wrench_source + 0.01),
    "clearance": ("swing_clearance", 1, ".2f", None),
    "drag %": ("dragging", 100, ".2f", lambda m: m.dragging_source + 0.005),
    "hips acc.": ("hips_acceleration", 1, ".2f", lambda m: 1.0),
    "CoM acc.": ("com_acceleration", 1, ".2f", lambda m: 1.0),
    "limb acc.": ("limb_acceleration", 1, ".2f", lambda m: PLAUSIBILITY.limb_throw),
    "contacts F1": ("contact_f1", 1, ".3f", None),
    "heading": ("heading_rad", 57.3, ".1f", lambda m: np.radians(8)),
    "drift cm": ("drift_m", 100, ".1f", lambda m: 0.1),
    "deep cm": ("deepest_m", 100, ".2f", lambda m: 0.01),
    "in air %": ("in_air", 100, ".2f", lambda m: 0.005),
    "skate cm/s": ("skate_m_s", 100, ".2f", lambda m: 0.03),
    "rests in air %": ("rests_in_air", 100, ".1f", lambda m: 0.02),
    "rests slide": ("rests_slide_m_s", 100, ".2f", lambda m: 0.04),
    "limbs": ("limb_error_rad", 57.3, ".2f", lambda m: np.radians(5)),
    "feet": ("foot_error_rad", 57.3, ".2f", None),
    "hands": ("hand_error_rad", 57.3, ".2f", None),
    "trunk": ("trunk_error_rad", 57.3, ".2f", None),
    "limit %": ("at_limit", 100, ".1f", lambda m: 0.0),
    "rad/s": ("fastest_rad_s", 1, ".1f", lambda m: 15.0),
    "jerk": ("jerk_rad_s3", 1, ".0f", lambda m: 400.0),
    "self %": ("self_collision", 100, ".2f", lambda m: 0.0),
    "torque %": ("over_torque", 100, ".1f", None),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, required=True)
    parser.add_argument("--robots", nargs="+", required=True)
    parser.add_argument("--clips", nargs="+", default=FOLDERS)
    parser.add_argument("--seconds", type=float, default=20.0, help="of each clip, at most")
    parser.add_argument("--all", action="store_true", help="sources that are implausible, too")
    parser.add_argument("--method", choices=("solve", "copy", "stream"), default="solve")
    args = parser.parse_args()
    clips = (clips_of if args.all else plausible_clips)(args.data, args.clips, args.seconds)
    method = {"solve": retarget, "copy": copy, "stream": follow}[args.method]
    for name in args.robots:
        robot = known(name)
        print(f"\n| {Path(name).stem}, {args.method} | {' | '.join(COLUMNS)} | frames/s |")
        print("|---|" + "---|" * (len(COLUMNS) + 1))
        rows = []
        for stem, source in clips.items():
            start = time.process_time()
            result = method(source, robot)
            fps = len(source) / (time.process_time() - start)
            rows.append(measure(from_canonical(source), source.rig, result))
            show(stem, rows[-1], fps)
        mean = mean_of(rows)
        show(f"mean of {len(rows)}", mean, np.nan)
        print(f"misses in the mean: {', '.join(misses(mean)) or 'none'}")


def clips_of(data: Path, patterns: Sequence[str], seconds: float) -> dict[str, CanonicalMotion]:
    """The BVH files of a folder that some patterns name, by their names."""
    paths = sorted(path for pattern in patterns for path in data.glob(pattern))
    return {path.stem: clip(path, seconds) for path in paths if path.suffix == ".bvh"}


def plausible_clips(
    data: Path, patterns: Sequence[str], seconds: float
) -> dict[str, CanonicalMotion]:
    """Those whose source is itself plausible, in most frames."""
    clips = clips_of(data, patterns, seconds)
    return {
        name: source
        for name, source in clips.items()
        if assess(Subject(from_canonical(source), source.rig)).implausible < CLEAN
    }


def clip(path: Path, seconds: float) -> CanonicalMotion:
    """The first seconds of a recording; of those that a converter put a T-pose before, without."""
    motion = read_recording(path).motion
    first = 2 if path.parent.name == "cmu_dance" else 0
    motion = motion.frames(first, min(len(motion), first + round(seconds / motion.frame_time)))
    return to_canonical(motion, understand(motion))


def follow(source: CanonicalMotion, robot: Morphology) -> RobotMotion:
    """Frame by frame, each answer beside the frame that it is for."""
    motion = from_canonical(source)
    stream = Stream(source.rig, robot, motion.frame_time, ground_of(source, robot))
    places = [None] * len(motion) if motion.translations is None else motion.translations
    frames = [Frame(*part) for part in zip(motion.root_pos, motion.rotations, places, strict=True)]
    qpos = [stream.step(frame) for frame in [*frames, *frames[-1:] * LATENCY]]
    return RobotMotion(robot, robot.from_qpos(np.array(qpos[LATENCY:])), motion.frame_time)


def mean_of(rows: list[RobotMetrics]) -> RobotMetrics:
    """The means of what the clips have, but the deepest and the fastest of all."""
    values = [asdict(row) for row in rows]
    out: dict[str, Any] = {}
    for field in values[0]:
        found = [row[field] for row in values if row[field] is not None]
        worst = field in ("deepest_m", "fastest_rad_s")
        out[field] = None if not found else float(np.max(found) if worst else np.mean(found))
    return RobotMetrics(**out)


def mean_solved(clips: Iterable[CanonicalMotion], robot: Morphology) -> RobotMetrics:
    """The means of clips that are solved for."""
    return mean_of([measure(from_canonical(c), c.rig, retarget(c, robot)) for c in clips])


def misses(metrics: RobotMetrics) -> list[str]:
    """The columns of the table that are over their bars."""
    out = []
    for title, (field, _, _, bar) in COLUMNS.items():
        value = getattr(metrics, field)
        if bar is not None and value is not None and value > bar(metrics):
            out.append(title)
    clearance = metrics.swing_clearance
    if clearance is not None and not 0.85 <= clearance <= 1.2:
        out.append("clearance")
    if metrics.contact_f1 is not None and metrics.contact_f1 < CONTACTS:
        out.append("contacts F1")
    return out


def cells(metrics: RobotMetrics, titles: Iterable[str] = COLUMNS) -> str:
    """A row of the table, or some of its columns."""
    out = []
    for field, factor, shape, _ in map(COLUMNS.__getitem__, titles):
        value = getattr(metrics, field)
        out.append("" if value is None else f"{factor * value:{shape}}")
    return " | ".join(out)


def show(label: str, metrics: RobotMetrics, fps: float) -> None:
    print(f"| {label} | {cells(metrics)} | {fps:.0f} |", flush=True)


if __name__ == "__main__":
    main()
