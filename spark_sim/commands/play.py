"""`spark-sim play`: watch motions, in a window, a video, a web page or a picture."""

from argparse import ArgumentParser, Namespace
from functools import partial
from pathlib import Path

from spark_sim.commands.options import add_corrections, add_force, add_robot_motion, load

SUMMARY = "watch motions: window, video, web page, picture"
USAGE = "FILE... [--video MP4] [--html HTML] [--strip PNG]"
DESCRIPTION = """\
Show the motion of each FILE on a MuJoCo body, several side by side: people on
bodies made from their skeletons, robots on their own models. Opens a window;
with --video, --html or --strip it writes files instead and needs no display."""
EXAMPLES = """\
examples:
  spark-sim play walk.bvh              # a window
  spark-sim play walk.bvh walk_on_mutant.bvh --html both.html
  spark-sim play walk.bvh walk_on_g1.npz --video walk.mp4 --strip walk.png
  spark-sim play theirs.csv --robot unitree_g1 --quat xyzw --fps 60
"""


def configure(parser: ArgumentParser) -> None:
    parser.add_argument(
        "files", metavar="FILE", nargs="+", help="a BVH, an FBX, or a robot's motion"
    )
    parser.add_argument("--video", metavar="MP4", help="write a video")
    parser.add_argument("--html", metavar="HTML", help="write one web page with a 3D replay")
    parser.add_argument("--strip", metavar="PNG", help="write a strip of moments as one picture")
    add_force(parser)
    add_corrections(parser, "every FILE")
    add_robot_motion(parser, "every FILE")


def run(args: Namespace) -> int:
    from spark_sim import clip, console

    outputs = {name: getattr(args, name) for name in ("video", "html", "strip")}
    wanted = {name: Path(path) for name, path in outputs.items() if path is not None}
    clips = [load(args, path) for path in args.files]
    clip.play(*clips, **wanted, force=args.force, progress=partial(console.progress, label="video"))
    for out in wanted.values():
        console.say(f"{out}: {out.stat().st_size / 1000:.0f} kB")
    return 0
