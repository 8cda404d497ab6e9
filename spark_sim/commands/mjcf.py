"""`spark-sim mjcf`: a MuJoCo body from a character's skeleton."""

from argparse import ArgumentParser, Namespace
from pathlib import Path

from spark_sim.commands.options import add_corrections, add_force, check_given, load

SUMMARY = "make a MuJoCo body from a character"
USAGE = "RIG [-o OUT] [options]"
DESCRIPTION = """\
Write a MuJoCo model (MJCF) of the skeleton in RIG: one body a bone, capsules
along the bones, boxes under the feet, human masses, servos strong enough to
stand, sensors, and a free joint at the root. OUT holds the body alone.
OUT_scene.xml, beside it, puts the body on a floor: open that one in a viewer."""
EXAMPLES = """\
examples:
  spark-sim mjcf mutant.bvh            # writes mutant.xml, mutant_scene.xml
  spark-sim mjcf mutant.bvh --joints hinge -o models/m.xml
  spark-sim mjcf mutant.bvh --mesh mutant.glb
"""


def configure(parser: ArgumentParser) -> None:
    parser.add_argument("rig", metavar="RIG", help="a character's file; its motion is not needed")
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        help="the file to write (default: RIG.xml in the current folder)",
    )
    parser.add_argument(
        "--joints",
        choices=("ball", "hinge"),
        default="ball",
        help="ball joints (default), or hinges: one at an elbow or knee, three elsewhere",
    )
    parser.add_argument(
        "--mesh",
        metavar="FILE",
        help="a skinned mesh on the same skeleton (.glb, .gltf, .vrm, .fbx): its convex hulls "
        "replace the capsules",
    )
    add_force(parser)
    add_corrections(parser, "RIG")


def run(args: Namespace) -> int:
    from spark_sim import console

    out = Path(args.output or f"{Path(args.rig).stem}.xml")
    check_given(args, [args.rig])
    rig = load(args, args.rig)
    written, notes = rig.save_mjcf(out, joints=args.joints, mesh=args.mesh, force=args.force)
    console.notes(out, notes)
    for path in written:
        console.say(str(path))
    return 0
