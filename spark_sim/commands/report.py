"""`spark-sim report`: how believable a motion is."""

import re
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from spark_sim.commands.options import (
    add_corrections,
    add_force,
    add_json,
    add_robot_motion,
    add_workers,
    check_given,
    load,
)
from spark_sim.commands.source_part import part_of

if TYPE_CHECKING:
    from spark_sim.clips import AnyClip

SUMMARY = "measure how believable a motion is"
USAGE = "FILE | FOLDER [--source SRC] [--html OUT] [options]"
DESCRIPTION = """\
Measure how plausible the motion in FILE is: penetration of the floor,
floating, skating, forces that the floor can't give, joint limits,
self-penetration. With --source, also measure the motion that it was made from,
how well the foot contacts agree, and how far the root drifts. With --truth,
also measure how far it is from the right answer.

A robot's motion, from any tool, is measured on the robot's own model: its
masses, shapes, soles and joint limits.

Of a FOLDER, every motion is measured, against the source that the batch's
manifest names or that --source has under the same name. FOLDER/report.html has
them all in a table, the worst first, and leads to a page for each. Beside it
is the table as JSON and CSV; with the extra `parquet`, as Parquet, too."""
EXAMPLES = """\
examples:
  spark-sim report walk_on_mutant.bvh --source walk.bvh
  spark-sim report walk_on_mutant.bvh --source walk.bvh --html report.html
  spark-sim report ours.bvh --compare theirs.bvh --source walk.bvh
  spark-sim report --compare a.npz b.npz --source walk.bvh --html both.html
  spark-sim report walk_on_g1.npz --source walk.bvh
  spark-sim report theirs.csv --robot unitree_g1 --quat xyzw --fps 60
  spark-sim report walk_on_mutant.bvh --truth mutant_walk.bvh --json
  spark-sim report walk_on_mutant.bvh --fail-over 5%
  spark-sim report out/                          # out/report.html, .csv, .json
  spark-sim report theirs/ --robot g1 --source mocap/ --html theirs.html
"""


def configure(parser: ArgumentParser) -> None:
    parser.add_argument(
        "file",
        metavar="FILE",
        nargs="?",
        help="a character's file, a robot's motion, or a folder of them",
    )
    parser.add_argument("--source", metavar="SRC", help="the motion that FILE was made from")
    parser.add_argument(
        "--truth",
        metavar="TRUTH",
        help="the right answer: the motion that FILE should be, on the same body",
    )
    parser.add_argument(
        "--html", metavar="OUT", help="also write a page: replay, worst moments, plots over time"
    )
    parser.add_argument(
        "--compare",
        metavar="OTHER",
        nargs="+",
        default=[],
        help="measure these files too, with the same options, and print one table; with --html "
        "they stand side by side on one page, with a replay",
    )
    parser.add_argument(
        "--fail-over",
        metavar="PERCENT",
        type=_percentage,
        help="exit with code 1 if more than this share of the frames is implausible",
    )
    add_workers(parser)
    add_json(parser, "the report")
    add_force(parser)
    add_corrections(parser, "FILE")
    add_robot_motion(parser, "FILE")
    add_corrections(parser, "SRC", "source-")
    add_robot_motion(parser, "SRC", "source-")


def run(args: Namespace) -> int:
    from robots.formats import is_sonic
    from spark.errors import ConventionError
    from spark_sim import api, console

    if args.file is not None and Path(args.file).is_dir() and not is_sonic(Path(args.file)):
        from spark_sim.commands.report_folder import report_folder

        return _verdict(args, report_folder(args))
    paths = [path for path in (args.file, *args.compare) if path is not None]
    if not paths:
        raise ConventionError("no FILE is given")
    if len({*paths}) < len(paths) or (args.compare and len(paths) < 2):
        raise ConventionError(
            "--compare puts two files or more beside each other, none of them twice"
        )
    if args.workers is not None:
        raise ConventionError("--workers goes with a folder; files are measured one by one")
    check_given(args, [*paths, args.truth] if args.truth else paths)
    check_given(args, [args.source] if args.source else [], "source-")
    source = None if args.source is None else load(args, args.source, "source-")
    if len(paths) > 1:
        return _verdict(args, _compared(args, paths, source))
    judged = load(args, paths[0])
    if source is not None:
        source = part_of(source, paths[0])
    truth = None if args.truth is None else load(args, args.truth)
    report = api.report(judged, source=source, truth=truth, html=args.html, force=args.force)
    if args.json:
        console.emit_json(report.json())
    else:
        console.say(report.text(color=console.uses_color()))
    return _verdict(args, report.implausible)


def _compared(args: Namespace, paths: list[str], source: "AnyClip | None") -> float:
    """Several files in one table, and on one page. Returns the worst share of implausible
    frames."""
    from sim.report import compare
    from spark_sim import api, console, files

    if args.html is not None:
        files.claim(Path(args.html), force=args.force, endings=(".html", ".htm"), what="a page")
    truth = None if args.truth is None else load(args, args.truth)
    stems = [Path(path).stem for path in paths]
    names = stems if len({*stems}) == len(stems) else paths
    clips = {name: load(args, path) for name, path in zip(names, paths, strict=True)}
    sources = {
        name: None if source is None else part_of(source, path)
        for name, path in zip(names, paths, strict=True)
    }
    reports = {
        name: api.report(clip, source=sources[name], truth=truth) for name, clip in clips.items()
    }
    if args.html is not None:
        from sim.report.compare_page import write_compare_page

        shown = sources[names[0]]
        origin = None if shown is None else (shown.name, shown.subject)
        subjects = {name: clip.subject for name, clip in clips.items()}
        listed = ", ".join([*names][:-1]) + f" and {names[-1]}"
        title = listed + ("" if source is None else f", of {source.name}")
        write_compare_page(reports, args.html, subjects, origin, title=title)
    if args.json:
        records = zip(paths, reports.values(), strict=True)
        console.emit_json({path: each.json() for path, each in records})
    else:
        console.say(compare(reports, color=console.uses_color()))
    return max(each.implausible for each in reports.values())


def _verdict(args: Namespace, worst: float | None) -> int:
    """The exit code, by the largest share of implausible frames; None where there is none."""
    from spark_sim import console

    if worst is None:
        return 2
    if args.fail_over is not None and 100 * worst > args.fail_over:
        console.error(
            f"{100 * worst:.4g} % of the frames are implausible, "
            f"--fail-over allows {args.fail_over:.4g} %"
        )
        return 1
    return 0


def _percentage(text: str) -> float:
    """`5%` and `5` are both 5."""
    match = re.fullmatch(r"(\d+(?:\.\d*)?|\.\d+)\s*%?", text.strip())
    if match is None or float(match[1]) > 100:
        raise ArgumentTypeError(f"{text!r} is no percentage; expected one such as 5%")
    return float(match[1])
