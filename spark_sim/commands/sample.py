"""`spark-sim sample`: demo motions made by code."""

from argparse import ArgumentParser, Namespace

from spark_sim.commands.options import add_force

SUMMARY = "write demo motions"
USAGE = "[DIR] [options]"
DESCRIPTION = """\
Write demo motions into DIR: a walk, a wave and a squat, made by code, on two
rigs that differ in names, proportions, rest pose, axes and unit."""
EXAMPLES = """\
examples:
  spark-sim sample                     # writes into samples/
  spark-sim sample motions/
"""


def configure(parser: ArgumentParser) -> None:
    parser.add_argument("folder", metavar="DIR", nargs="?", default="samples")
    add_force(parser)


def run(args: Namespace) -> int:
    from spark_sim import api, console

    for path in api.sample(args.folder, force=args.force):
        console.say(str(path))
    return 0
