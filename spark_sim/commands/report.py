"""`spark-sim report`: how believable a motion is."""

import re
from argparse import ArgumentParser, ArgumentTypeError, Namespace

from spark_sim.commands.options import add_corrections, add_json, load

SUMMARY = "measure how believable a motion is"
USAGE = "FILE [--source SRC] [--fail-over PERCENT] [options]"
DESCRIPTION = """\
Measure the physical plausibility of the motion in FILE: feet below the floor,
floating, skating, joint limits; with --source also what the motion it came
from does, and how far the root drifts from it."""
EXAMPLES = """\
examples:
  spark-sim report walk_on_mutant.bvh --source walk.bvh
  spark-sim report walk_on_mutant.bvh --json > report.json
  spark-sim report walk_on_mutant.bvh --fail-over 5%
"""


def configure(parser: ArgumentParser) -> None:
    parser.add_argument("file", metavar="FILE", help="a BVH file")
    parser.add_argument("--source", metavar="SRC", help="the motion that FILE was made from")
    parser.add_argument(
        "--fail-over",
        metavar="PERCENT",
        type=_percentage,
        help="exit with code 1 where more of the frames are implausible",
    )
    add_json(parser, "the report")
    add_corrections(parser, "FILE")
    add_corrections(parser, "SRC", "source-")


def run(args: Namespace) -> int:
    from spark_sim import clip, console

    judged = load(args, args.file)
    source = None if args.source is None else load(args, args.source, "source-")
    report = clip.report(judged, source=source)
    if args.json:
        console.emit_json(report.json())
    else:
        console.say(report.text(color=console.uses_color()))
    if args.fail_over is not None and 100 * report.implausible > args.fail_over:
        console.error(
            f"{100 * report.implausible:.3g} % of the frames are implausible, "
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
