"""Does the report measure what it says? Spoil real clips, and see which measure tells.

For each corruption and each measure: the AUC, the chance that a spoilt clip scores higher than a
clean one. 1 tells them apart always, 0.5 not at all. `python -m scripts.report_bench DATA` prints
the table of docs/report.md.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
from scipy.stats import rankdata
from tqdm import tqdm

from scripts.corruptions import CORRUPTIONS, HARMLESS
from sim.report import Report, Subject, assess
from sim.report.course import course_of
from sim.report.names import FLAGS
from sim.report.thresholds import PLAUSIBILITY
from spark.constants import GRAVITY
from spark.errors import SkeletonError, SparkSimError
from spark.io.recording import read_recording
from spark.motion import Motion
from spark.rig.rig import Rig, understand

FOLDERS = ("cmu_asf", "cmu_expmap", "reactidle", "animateddrawings")
PER_FOLDER = 12
SECONDS = 8.0
TRAVEL = 2.0  # [m] that a clip must go for "in place" to change it
# A clean clip is its own source and differs from it by nothing at all: what is smaller than this
# counts as nothing too [m, rad, share].
DRIFT, HEADING, CONTACTS, CLEARANCE = 0.02, np.radians(5), 0.1, 0.05
BASE = 1.05  # times the source's acceleration, or half of gravity where that is more
LIMB = 1.2  # times the source's acceleration
POSE, TREMBLE = np.radians(1), 1.5  # in the mean; times the source's, or a millimetre

MEASURES = (
    "any",
    *FLAGS,
    "limits",
    "self",
    "drift",
    "heading",
    "contacts",
    "clearance",
    "base",
    "limb",
    "speed",
    "jerk",
    "balance",
    "pose",
    "tremble",
)


def scores(report: Report) -> dict[str, float]:
    """One number a measure, higher is worse; nan where the clip has nothing of what is measured."""
    clip, drift, contacts, swing = report.clip, report.drift, report.contacts, report.swing
    assert drift is not None
    assert contacts is not None
    assert report.source is not None
    thrown = report.scale * report.source.base_acceleration_p99
    return {
        "any": report.implausible,
        **clip.shares,
        "limits": clip.limit_share,
        "self": float(clip.self_penetration.mean()),
        "drift": coarse(float(drift.distance.max()), DRIFT),
        "heading": coarse(float(np.abs(drift.heading).max()), HEADING),
        "contacts": 0.0 if contacts.f1 is None else coarse(1 - contacts.f1, CONTACTS),
        "clearance": np.nan if swing is None else coarse(abs(1 - swing.clearance), CLEARANCE),
        "base": coarse(clip.base_acceleration_p99 / max(thrown, 0.5 * GRAVITY), BASE),
        "limb": 0.0 if report.limbs is None else coarse(report.limbs.ratio, LIMB),
        "speed": float(clip.joint_pace.max()),
        "jerk": clip.jerk_rms,
        "balance": clip.unbalanced_share or 0.0,
        "pose": 0.0 if report.pose is None else coarse(report.pose.mean, POSE),
        "tremble": _tremble(report),
    }


def _tremble(report: Report) -> float:
    """Over the source's, or over a millimetre where that is more."""
    theirs = report.tremble.source_largest or 0.0
    return coarse(report.tremble.largest / max(theirs, 1e-3), TREMBLE)


def coarse(value: float, least: float) -> float:
    """`value`, or 0 where it is less than `least`."""
    return value if value >= least else 0.0


def auc(clean: list[float], spoilt: list[float]) -> float:
    """The chance that a spoilt clip scores higher than a clean one, ties counting half."""
    ranks = rankdata(np.concatenate([spoilt, clean]))
    count = len(spoilt)
    return float((ranks[:count].sum() - count * (count + 1) / 2) / (count * len(clean)))


def clips(data: Path) -> Iterator[tuple[str, Motion, Rig]]:
    """Recordings of people whose feet stay on a level floor, at most `PER_FOLDER` of each folder.

    Level: the lowest point of the soles is within 4 cm of the floor in nine of ten frames.
    """
    for folder in FOLDERS:
        found: list[tuple[str, Motion, Rig]] = []
        for path in sorted((data / folder).glob("*.bvh")):
            try:
                motion = read_recording(path).motion
                motion = motion.frames(0, int(SECONDS / motion.frame_time))
                rig = understand(motion)
                lowest = course_of(Subject(motion, rig)).lowest[:, 2]
            except SparkSimError as error:
                print(f"left out: {error}", file=sys.stderr)
                continue
            height = lowest - np.percentile(lowest, 5)
            limit = PLAUSIBILITY.scaled(rig.hip_height).floating
            if motion.duration >= 1 and (height > limit).mean() <= 0.1:
                found.append((path.stem, motion, rig))
        step = max(1, -(-len(found) // PER_FOLDER))
        yield from found[::step]


def bench(data: Path) -> tuple[int, dict[str, dict[str, float]]]:
    """The number of clips, and for each corruption the AUC of each measure against clean."""
    clean: dict[str, dict[str, float]] = {}
    spoilt: dict[str, dict[str, dict[str, float]]] = {name: {} for name in CORRUPTIONS}
    for name, motion, rig in tqdm(list(clips(data)), file=sys.stderr, disable=None):
        rng = np.random.default_rng(len(clean))
        source = Subject(motion, rig)
        report = assess(source, source=source)
        clean[name] = scores(report)
        assert report.drift is not None
        for kind, corrupt in CORRUPTIONS.items():
            if kind == "in place" and report.drift.path_length < TRAVEL:
                continue
            try:
                changed = corrupt(motion, rig, rng)
            except SkeletonError:  # it spoils a joint that this body lacks
                continue
            # A mirrored motion walks another path by intent: it is its own source.
            subject = Subject(changed, rig)
            origin = subject if kind == "mirrored" else source
            spoilt[kind][name] = scores(assess(subject, source=origin))
    return len(clean), separation(clean, spoilt)


def separation(
    clean: dict[str, dict[str, float]],
    spoilt: dict[str, dict[str, dict[str, float]]],
    measures: Sequence[str] = MEASURES,
) -> dict[str, dict[str, float]]:
    """For each corruption the AUC of each measure, over the clips that have what it measures."""
    return {
        kind: {
            measure: auc([clean[n][measure] for n in asked], [rows[n][measure] for n in asked])
            for measure in measures
            if (asked := [n for n in rows if np.isfinite(clean[n][measure] + rows[n][measure])])
        }
        for kind, rows in spoilt.items()
        if rows
    }


def table(result: dict[str, dict[str, float]], measures: Sequence[str] = MEASURES) -> str:
    """Markdown; bold where a measure tells a harm in 95 % of the pairs."""
    lines = [
        "| corruption | " + " | ".join(measures) + " |",
        "|---|" + "---:|" * len(measures),
    ]
    for kind, row in result.items():
        cells = (
            f"**{value:.2f}**" if value >= 0.95 and kind not in HARMLESS else f"{value:.2f}"
            for value in row.values()
        )
        lines.append(f"| {kind} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, help="the folder with the recordings")
    count, result = bench(parser.parse_args().data)
    print(f"{count} clips\n\n{table(result)}")


if __name__ == "__main__":
    main()
