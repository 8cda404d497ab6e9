"""`spark-sim prepare`: motion files into a dataset to train on."""

import os
from argparse import ArgumentParser, Namespace
from pathlib import Path

from spark_sim.commands.options import add_force

SUMMARY = "make a dataset to train on"
USAGE = "SRC... -o DATASET [options]"
DESCRIPTION = """\
Read every BVH and FBX file below each SRC and write one dataset: 30 frames a
second, bodies without fingers, hair and clothes, canonical rotations. Made for
Mixamo downloads, one folder a character, and good for any tree of files.
Characters and motions are split into those that training sees and the others:
the paper's characters by name, the rest drawn. A run that stopped goes on
where it was; run again with more files, it reads only those."""
EXAMPLES = """\
examples:
  spark-sim prepare mixamo/ -o dataset
  spark-sim prepare cmu/ lafan1/ -o dataset --workers 8
  spark-sim train dataset -o run
"""


def configure(parser: ArgumentParser) -> None:
    parser.add_argument("sources", metavar="SRC", nargs="+", help="folders, or BVH and FBX files")
    parser.add_argument("-o", "--output", metavar="DATASET", required=True, help="the folder")
    parser.add_argument("--seed", metavar="N", type=int, default=0, help="of the split (default 0)")
    parser.add_argument(
        "--workers", metavar="N", type=int, help="processes (default: one for each core)"
    )
    add_force(parser)


def run(args: Namespace) -> int:
    from spark.errors import ConventionError
    from spark.training.dataset import prepare
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
        progress=lambda files, total: console.progress(files, "preparing", total),
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
