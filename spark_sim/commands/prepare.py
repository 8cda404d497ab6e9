"""`spark-sim prepare`: motion files into a dataset to train on."""

import os
from argparse import ArgumentParser, Namespace
from pathlib import Path

from spark_sim.commands.options import add_force

SUMMARY = "make a dataset to train on"
USAGE = "SRC... -o DATASET [options]"
DESCRIPTION = """\
Read every motion below each SRC and write one dataset: canonical
rotations at 30 frames a second, without fingers, hair and clothes. It is made
for Mixamo downloads, one folder a character, and takes any tree of files.

Some characters and motions are set aside for testing: those of the paper by
name, others by a draw. A run that was interrupted continues where it stopped.
A second run with more files reads only the new ones."""
EXAMPLES = """\
examples:
  spark-sim prepare mixamo/ -o dataset
  spark-sim prepare cmu/ lafan1/ -o dataset --workers 8
  spark-sim train dataset -o run
"""


def configure(parser: ArgumentParser) -> None:
    parser.add_argument("sources", metavar="SRC", nargs="+", help="folders of motions, or motions")
    parser.add_argument(
        "-o", "--output", metavar="DATASET", required=True, help="the folder to write"
    )
    parser.add_argument(
        "--seed", metavar="N", type=int, default=0, help="seed of the draw (default 0)"
    )
    parser.add_argument(
        "--workers", metavar="N", type=int, help="number of processes (default: one a core)"
    )
    add_force(parser)


def run(args: Namespace) -> int:
    from spark.errors import ConventionError
    from spark.training.prepare import prepare
    from spark_sim import console

    out = Path(args.output)
    workers = os.cpu_count() or 1 if args.workers is None else args.workers
    if workers < 1:
        raise ConventionError(f"--workers {workers}: expected 1 or more")
    index = prepare(
        [Path(source) for source in args.sources],
        out,
        seed=args.seed,
        workers=workers,
        force=args.force,
        progress=lambda files, total: console.progress(files, "preparing", total, lines=True),
    )
    for left in index["left_out"]:
        console.note(f"{left['file']}: left out: {left['why']}")
    clips = index["clips"]
    seconds = sum(clip["frames"] for clip in clips) * index["frame_time"]
    cells = ", ".join(f"{name} {count}" for name, count in index["cells"].items())
    console.say(
        f"{out}: {len(clips)} clips of {len(index['bodies'])} bodies, {seconds / 60:.3g} minutes "
        f"({cells}); {len(index['left_out'])} files left out"
    )
    return 0
