"""`spark-sim play`: watch motions, in a window, a video, a web page or a picture."""

from argparse import ArgumentParser, Namespace
from functools import partial
from pathlib import Path
from textwrap import fill
from typing import Any

from spark_sim.commands.options import add_corrections, add_force, add_json, add_robot_motion, load

SUMMARY = "watch motions: window, video, web page, picture"
USAGE = "FILE... [--video MP4] [--html HTML] [--strip PNG]"
DESCRIPTION = """\
Show the motions of all FILEs side by side, characters on MuJoCo bodies made
from their skeletons, robots on their own models. This opens a window. With
--video, --html or --strip it writes files instead and needs no display.

With --physics, position servos track each motion in simulation. A summary says
how long the body stays up, how far it is from the motion, and the torques."""
EXAMPLES = """\
examples:
  spark-sim play walk.bvh              # a window
  spark-sim play walk.bvh walk_on_mutant.bvh --html both.html
  spark-sim play walk.bvh walk_on_g1.npz --video walk.mp4 --strip walk.png
  spark-sim play theirs.csv --robot unitree_g1 --quat xyzw --fps 60
  spark-sim play walk_on_g1.npz --physics --assist --html physics.html
"""


def configure(parser: ArgumentParser) -> None:
    parser.add_argument(
        "files", metavar="FILE", nargs="+", help="a BVH or FBX file, or a robot's motion"
    )
    parser.add_argument("--video", metavar="MP4", help="write a video")
    parser.add_argument("--html", metavar="HTML", help="write one web page with a 3D replay")
    parser.add_argument("--strip", metavar="PNG", help="write a strip of moments as one picture")
    parser.add_argument(
        "--physics",
        action="store_true",
        help="track each motion in simulation, and print a summary",
    )
    parser.add_argument(
        "--assist",
        action="store_true",
        help="with --physics: a force and a torque on the root help",
    )
    add_json(parser, "the summary of --physics")
    add_force(parser)
    add_corrections(parser, "every FILE")
    add_robot_motion(parser, "every FILE")


def run(args: Namespace) -> int:
    from spark.errors import ConventionError
    from spark_sim import api, console

    if not args.physics and (args.assist or args.json):
        raise ConventionError("--assist and --json go with --physics")
    outputs = {name: getattr(args, name) for name in ("video", "html", "strip")}
    wanted = {name: Path(path) for name, path in outputs.items() if path is not None}
    shown: list[Any] = [load(args, path) for path in args.files]
    if args.physics:
        shown = _simulated(args, shown)
    if wanted or not args.json:
        progress = partial(console.progress, label="video")
        api.play(*shown, **wanted, force=args.force, progress=progress)
    for out in wanted.values():
        size = f"{out}: {out.stat().st_size / 1000:.0f} kB"
        console.note(size) if args.json else console.say(size)
    return 0


def _simulated(args: Namespace, clips: list[Any]) -> list[Any]:
    """The clips as they come out of the simulation; the report is printed."""
    from spark_sim import console
    from spark_sim.simulation import LIMITS, simulate

    made = [simulate(each, assist=args.assist) for each in clips]
    for path, each in zip(args.files, made, strict=True):
        console.notes(path, each.notes)
    if args.json:
        for each in made:
            console.emit_json(each.json())
    else:
        console.say("\n\n".join([*(each.text() for each in made), fill(LIMITS, 79)]))
    return list(made)
