"""`spark-sim sample`: demo motions made by code."""

from argparse import ArgumentParser, Namespace

from spark_sim.commands.options import add_force

SUMMARY = "write demo motions"
USAGE = "[DIR] [options]"
DESCRIPTION = """\
Write six demo motions into DIR: a walk, a wave and a squat, each on two rigs.
The rigs differ in joint names, proportions, rest pose, axes and unit."""
EXAMPLES = """\
examples:
  spark-sim sample                     # writes into samples/
  spark-sim sample motions/
"""


def configure(parser: ArgumentParser) -> None:
    parser.add_argument(
        "folder",
        metavar="DIR",
        nargs="?",
        default="samples",
        help="the folder to write to (default: samples)",
    )
    add_force(parser)


def run(args: Namespace) -> int:
    from spark_sim import api, console

    for path in api.sample(args.folder, force=args.force):
        console.say(str(path))
    return 0
