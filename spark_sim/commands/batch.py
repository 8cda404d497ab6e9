"""`spark-sim batch`: a shelf of motions onto several bodies."""

import re
import time
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from robots.formats import FORMATS, SONIC_FPS
from spark_sim.choices import Method
from spark_sim.commands.options import (
    add_corrections,
    add_force,
    add_json,
    add_robot_motion,
    add_workers,
    check_given,
    given,
    workers,
)

if TYPE_CHECKING:
    from spark_sim.shelf.batch import Backend
    from spark_sim.shelf.plan import Job

SUMMARY = "put folders of motions on several bodies, and measure them"
USAGE = "IN... --to TARGET [--to TARGET] -o OUT [options]"
DESCRIPTION = """\
Put every motion below each IN on every TARGET, and measure each result against
its source. OUT gets a folder for each target, with the tree of folders below
IN, and manifest.jsonl: a line for each result, with hashes, options, report,
notes and error.

Run it again and it makes what is missing or changed, and nothing else. It may
be killed at any moment. A file that fails does not stop the others."""
EXAMPLES = """\
examples:
  spark-sim batch mocap/ --to g1 --to t1 -o out/
  spark-sim batch mocap/ --to g1 -o out/ --format mjlab --fps 50
  spark-sim batch mocap/ --to g1 -o out/ --mirror --cut 10s
  spark-sim batch mocap/ --to g1 -o out/ --keep "implausible < 5%"
  spark-sim batch mocap/ --to g1 -o out/ --shard 3/8  # the third of 8 machines
"""


def configure(parser: ArgumentParser) -> None:
    parser.add_argument("sources", metavar="IN", nargs="+", help="folders of motions, or motions")
    parser.add_argument(
        "--to",
        metavar="TARGET",
        required=True,
        action="append",
        help="a body to put the motions on, as in `spark-sim retarget`; may be given several times",
    )
    parser.add_argument(
        "-o", "--output", metavar="OUT", required=True, help="the folder of the results"
    )
    parser.add_argument(
        "--format",
        choices=tuple(FORMATS),
        metavar="NAME",
        help=f"of robots' motions: {', '.join(FORMATS)} (default npz)",
    )
    parser.add_argument("--fps", metavar="N", type=float, help="frame rate of the results")
    parser.add_argument("--method", choices=get_args(Method), default="spark", help="see retarget")
    parser.add_argument(
        "--keep",
        metavar="CONDITION",
        help="write only results that meet it: measures of the report, compared with numbers "
        "(< <= > >=), joined by and, or, not and parentheses",
    )
    parser.add_argument(
        "--mirror", action="store_true", help="make each motion with left and right exchanged, too"
    )
    parser.add_argument(
        "--cut",
        metavar="SECONDS",
        type=_seconds,
        help="cut each motion at moments of rest, and where it is broken, into pieces that are no "
        "longer (10s)",
    )
    add_workers(parser)
    parser.add_argument(
        "--backend",
        choices=("local", "ray"),
        default="local",
        help="processes of this machine (default), or all cores of the Ray cluster that "
        "RAY_ADDRESS names or this machine belongs to; IN, OUT and TARGET then lie on storage "
        "that all its machines see",
    )
    parser.add_argument(
        "--shard",
        metavar="I/N",
        type=_shard,
        help="do the I-th of N shares (1/N to N/N): for array jobs on several machines",
    )
    add_force(parser)
    add_json(parser, "what the run came to")
    add_corrections(parser, "every IN")
    add_robot_motion(parser, "every IN", fps="source-fps")


def run(args: Namespace) -> int:
    from spark.errors import ConventionError
    from spark.summary import counted
    from spark_sim import console
    from spark_sim.clip_base import MAX_FPS
    from spark_sim.files import one_run
    from spark_sim.shelf.batch import Batch
    from spark_sim.shelf.keep import parse
    from spark_sim.shelf.plan import Options, plan
    from spark_sim.shelf.work import target_clip
    from spark_sim.sources import sentences

    out = Path(args.output)
    reading = given(args, fps="source-fps")
    if args.fps is not None and not 0 < args.fps <= MAX_FPS:
        raise ConventionError(f"--fps {args.fps:g}: expected a rate above 0, up to {MAX_FPS}")
    fps = SONIC_FPS if args.fps is None and args.format == "sonic" else args.fps
    options = Options(args.method, args.format, fps, args.cut, reading)
    keep = None if args.keep is None else parse(args.keep)
    jobs, left_out = plan(args.sources, args.to, out, options, mirror=args.mirror)
    for sentence in sentences(left_out):
        console.note(sentence)
    check_given(args, list(dict.fromkeys(job.source for job in jobs)), fps="source-fps")
    backend = _backend(args)
    for target in args.to:
        console.notes(target, target_clip(target).notes)
    shard = ""
    if args.shard is not None:
        number, count = args.shard
        jobs, shard = jobs[number - 1 :: count], f"{number}of{count}"
    start = time.perf_counter()
    with one_run(out, shard), console.meter(len(jobs), 0, "batch", lines=True) as tell:
        batch = Batch(out, keep=keep, shard=shard, force=args.force)
        for count, (job, entries) in enumerate(batch.run(jobs, backend), 1):
            if error := entries[0]["error"]:
                console.error(error if str(job.source) in error else f"{job.source}: {error}")
            rate = batch.tally.frames / (time.perf_counter() - start)
            tell(count, {"frames/s": rate} if rate else {}, batch.tally.share)
    tally, duplicates = batch.tally, batch.near_duplicates(jobs)
    for sentence in duplicates.sentences():
        console.note(sentence)
    if args.json:
        console.emit_json(
            {
                "output": str(out),
                "jobs": len(jobs),
                "written": tally.written,
                "unchanged": tally.unchanged,
                "left_out": tally.left_out,
                "failed": tally.failed,
                "reasons": [{"source": s, "error": error} for s, error in tally.reasons],
                "no_sources": [{"file": str(f), "reason": reason} for f, reason in left_out],
                "near_duplicates": duplicates.groups,
                "parts": duplicates.records(),
                "seconds": time.perf_counter() - start,
            }
        )
    else:
        others = f"; {counted(len(left_out), 'file')} left out" if left_out else ""
        console.say(f"{out}: {tally.sentence()}{others}")
    return 2 if tally.failed else 0


def _backend(args: Namespace) -> "Backend":
    """Who does the jobs: processes of this machine, which begin to start, or a cluster's."""
    from functools import partial

    from spark.errors import ConventionError

    if args.backend == "ray":
        if args.workers is not None:
            raise ConventionError("--workers goes with --backend local; Ray uses a cluster's cores")
        from spark_sim.shelf.ray_cluster import on_ray

        return on_ray

    from spark_sim.shelf.processes import begin, in_processes

    begin()
    return partial(in_processes, workers=workers(args), slow=_at_work)


def _at_work(job: "Job", seconds: float) -> None:
    from spark_sim import console

    console.note(f"{job.source} onto {job.target}: at work for {console.duration(seconds)}")


def _seconds(text: str) -> float:
    """`10s` and `10` are both 10."""
    match = re.fullmatch(r"(\d+(?:\.\d*)?|\.\d+)\s*s?", text.strip())
    if match is None or not 0.5 <= float(match[1]) <= 1e5:
        raise ArgumentTypeError(f"{text!r} is no time; expected 0.5s or more, such as 10s")
    return float(match[1])


def _shard(text: str) -> tuple[int, int]:
    """`3/8` is the third of eight."""
    match = re.fullmatch(r"(\d{1,6})/(\d{1,6})", text.strip())
    if match is None or not 1 <= int(match[1]) <= int(match[2]):
        raise ArgumentTypeError(f"{text!r} is no share; expected I/N with I from 1 to N, as 3/8")
    return int(match[1]), int(match[2])
