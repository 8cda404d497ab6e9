"""Measure what becomes of spoilt recordings on characters.

    python scripts/tremble_bench.py DATA TARGET... [--as-they-are]

Clips and faults are those of `scripts.recordings_bench`, at 30 fps. Implausible frames and contacts
are those of the plausibility report beside the clip as it was; *joints* are how far they are from
where the clean clip puts them, in % of the standing height. Means over clips and targets, as
Markdown. With --as-they-are nothing is smoothed.
"""

import argparse
from pathlib import Path

import numpy as np

from scripts.characters_bench import read
from scripts.recordings_bench import CLIPS, KINDS, at_rate
from scripts.robot_bars import plausible_clips
from sim.report.assess import assess
from sim.trajectory import Subject
from spark.kinematics import forward
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.transfer.analytic import transfer
from spark.transfer.canonical import CanonicalMotion, from_canonical, to_canonical
from spark.transfer.noise import without_noise
from spark.transfer.own_soles import fit_body
from spark.transfer.refine import refined

FPS, SECONDS = 30.0, 8.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("targets", type=Path, nargs="+")
    parser.add_argument("--as-they-are", action="store_true")
    args = parser.parse_args()
    rigs = [read(path)[1].rig for path in args.targets]
    clean = [at_rate(clip, FPS) for clip in plausible_clips(args.data, CLIPS, SECONDS).values()]
    print("| | implausible, % | skating, % | root wrench, % | contacts, F1 | joints, % |")
    print("|---|---|---|---|---|---|")
    for kind, spoil in KINDS.items():
        rows = []
        for k, source in enumerate(clean):
            motion = from_canonical(source)
            spoilt = spoil(motion, source.rig, np.random.default_rng(k))
            given = to_canonical(spoilt, source.rig)
            for rig in rigs:
                made = from_canonical(retargeted(given, rig, smooth=not args.as_they_are))
                wanted = from_canonical(retargeted(source, rig, smooth=True))
                rows.append(judged(made, wanted, rig, Subject(motion, source.rig)))
        implausible, skating, wrench, f1, joints = np.mean(rows, axis=0)
        shares = f"{implausible:.1f} | {skating:.1f} | {wrench:.1f}"
        print(f"| {kind} | {shares} | {f1:.3f} | {joints:.2f} |", flush=True)


def retargeted(source: CanonicalMotion, rig: Rig, *, smooth: bool) -> CanonicalMotion:
    """As `spark_sim.retarget`, without a network."""
    source, noise, _ = without_noise(source) if smooth else (source, None, ())
    return refined(source, fit_body(source, transfer(source, rig)), noise)


def judged(made: Motion, wanted: Motion, rig: Rig, source: Subject) -> list[float]:
    report = assess(Subject(made, rig), source=source)
    assert report.contacts is not None
    assert report.contacts.f1 is not None
    away = np.linalg.norm(forward(made)[0] - forward(wanted)[0], axis=-1).mean()
    shares = (report.clip.shares[name] for name in ("skating", "root_wrench"))
    in_percent = (report.clip.implausible_share, *shares, away / rig.standing_height)
    implausible, skating, wrench, joints = (100 * share for share in in_percent)
    return [implausible, skating, wrench, report.contacts.f1, joints]


if __name__ == "__main__":
    main()
