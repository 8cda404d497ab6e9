"""`spark-sim inspect`: what is understood of a file."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from spark_sim.commands.options import (
    add_corrections,
    add_force,
    add_json,
    add_robot_motion,
    check_given,
    load,
)

SUMMARY = "show what is understood of a file"
USAGE = "FILE... [--html HTML] [--save-map TOML] [options]"
DESCRIPTION = """\
Show what is understood of each FILE: unit, up axis, frame rate, and the role
of each joint, with the confidence, the reason, the body parts that the joint
belongs to, and the angle between its rest pose and the T-pose. To correct a
role, save the map, edit it, and give it back with --map; or open the page that
--html writes: it shows the rig, and a click gives a joint another role."""
EXAMPLES = """\
examples:
  spark-sim inspect mutant.bvh
  spark-sim inspect mutant.bvh --save-map mutant.toml
  spark-sim inspect mutant.bvh --map mutant.toml   # after editing
  spark-sim inspect mutant.bvh --html mutant.html  # to look at, and to correct
  spark-sim retarget walk.bvh --to mutant.bvh --to-map mutant.toml
"""


def configure(parser: ArgumentParser) -> None:
    parser.add_argument(
        "files",
        metavar="FILE",
        nargs="+",
        help="a character's file, a robot's motion, or a robot's name",
    )
    parser.add_argument(
        "--save-map", metavar="TOML", help="write the map of joints of FILE, to edit"
    )
    parser.add_argument(
        "--html", metavar="HTML", help="write a page that shows FILE's rig and corrects its map"
    )
    add_force(parser)
    add_json(parser, "one line for each FILE")
    add_corrections(parser, "FILE")
    add_robot_motion(parser, "FILE")


def run(args: Namespace) -> int:
    from spark.errors import OutputError
    from spark_sim import console, files, rolemap
    from spark_sim.describe import describe, text

    out = None if args.save_map is None else Path(args.save_map)
    page = None if args.html is None else Path(args.html)
    for written, option, endings, what in (
        (out, "--save-map", (".toml",), "a map of joints"),
        (page, "--html", (".html", ".htm"), "a page"),
    ):
        if written is not None:
            if len(args.files) > 1:
                raise OutputError(f"{option} takes one FILE; each rig has a map of its own")
            files.claim(written, force=args.force, endings=endings, what=what)
    check_given(args, args.files)
    for path in args.files:
        clip = load(args, path, humanoid=False)
        described = describe(clip)
        if args.json:
            console.emit_json(described)
        else:
            console.say(text(described))
        if out is not None:
            known = clip.rig.roles if described["body"] is not None else None
            rolemap.write(clip.motion.skeleton, known, out)
            console.note(f"{out}: edit it, then give it back with --map {out}")
        if page is not None:
            from spark_sim.commands.rig_page import write_rig_page

            write_rig_page(clip, described, page, path)
            console.note(f"{page}: open it in a browser")
    return 0
