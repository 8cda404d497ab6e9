"""`spark-sim retarget`: motions onto another body."""

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from robots.formats import FORMATS, SONIC_FPS, is_sonic
from spark_sim.choices import Method
from spark_sim.commands.options import (
    add_corrections,
    add_force,
    add_json,
    add_robot_motion,
    check_given,
    load,
)

if TYPE_CHECKING:
    from spark_sim.clips import AnyClip

SUMMARY = "put motions on another body"
USAGE = "SRC... --to TARGET [-o OUT] [options]"
DESCRIPTION = """\
Put the motion of each SRC on the body of TARGET. Both may be any humanoid rig
or robot. Rest poses, axes, units, proportions and joint names may differ. On a
character the result is a BVH file with TARGET's own hierarchy, channels, unit
and axes; or a GLB (-o OUT.glb), with TARGET's skin where it is an FBX, glTF
or VRM that has one; or a VRM animation (-o OUT.vrma).
On a robot it is the coordinates of its joints, as your trainer reads them
(.npz, .csv, .pkl, .motion, or a folder)."""
EXAMPLES = """\
examples:
  spark-sim retarget walk.bvh --to mutant.bvh       # writes walk_on_mutant.bvh
  spark-sim retarget walk.bvh --to mutant.bvh -o out.bvh
  spark-sim retarget walk.bvh --to hero.vrm -o out.glb
  spark-sim retarget takes/ --to mutant.bvh -o out/ # every file below takes/
  spark-sim retarget walk.bvh --to robot            # writes walk_on_robot.npz
  spark-sim retarget walk.bvh --to unitree_g1 -o walk.csv
  spark-sim retarget walk.bvh --to g1 --format sonic --fps 50 --start 1 --end 4
  spark-sim retarget g1.csv --robot g1 --quat xyzw --source-fps 60 --to t1.xml
"""


def configure(parser: ArgumentParser) -> None:
    parser.add_argument(
        "sources",
        metavar="SRC",
        nargs="+",
        help="motions, or folders of them (with --robot, a robot's own too)",
    )
    parser.add_argument(
        "--to",
        metavar="TARGET",
        required=True,
        help="the body to put the motion on: a character's file, a robot's name "
        "(`spark-sim robots`), or any humanoid robot's MJCF (.xml) or URDF (.urdf)",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        help="the file to write, or a folder (named with a / at its end) for several motions. "
        "Default: SRC_on_TARGET.bvh, for a robot .npz, in the current folder",
    )
    parser.add_argument(
        "--format",
        choices=tuple(FORMATS),
        metavar="NAME",
        help="of a robot's motion, where the ending leaves it open. For .npz: npz (default), "
        "mjlab, beyondmimic (Isaac Lab's order), holosoma, holomotion or locomujoco. For .csv: "
        "csv (Unitree's, quaternions xyzw; default), csv-wxyz or bones-seed. For .pkl: gmr. For "
        ".motion: protomotions. A folder: sonic",
    )
    parser.add_argument(
        "--fps",
        metavar="N",
        type=float,
        help="frames a second of the result (default: those of SRC)",
    )
    parser.add_argument(
        "--start", metavar="S", type=float, help="begin at this second of SRC (default: 0)"
    )
    parser.add_argument(
        "--end", metavar="S", type=float, help="stop at this second of SRC (default: its end)"
    )
    parser.add_argument(
        "--method",
        choices=get_args(Method),
        default="spark",
        help="spark (default) or copy. On a character both turn each joint as its counterpart "
        "turns. spark then fits the legs, so that the feet take SRC's steps, and where SRC has no "
        "counterpart asks a trained network and TARGET's own motion; copy interpolates there, as a "
        "baseline. On a robot, spark solves for the whole trajectory; copy only copies each pose "
        "to the hinges",
    )
    parser.add_argument(
        "--checkpoint",
        metavar="FILE",
        help="a network that `spark-sim train` wrote, instead of the one that ships (characters "
        "only)",
    )
    parser.add_argument(
        "--no-refine",
        dest="refine",
        action="store_false",
        help="stop after the transfer: feet are not held where SRC's stand, hands and knees not "
        "kept over the floor, a SRC that trembles not smoothed. On a robot: the same as --method "
        "copy",
    )
    parser.add_argument(
        "--keep-touches",
        action="store_true",
        help="of a character: hands stay on what SRC's touch, each other and their own body, where "
        "other proportions bring them apart (robots' always do)",
    )
    parser.add_argument(
        "--terrain",
        metavar="FILE",
        help="of a robot: the ground under SRC. A mesh (.obj, .stl, .ply, .glb) in the unit and "
        "axes of SRC's file, or the fixed shapes of an MJCF or URDF. It is scaled as the motion is",
    )
    add_force(parser)
    add_json(parser, "one line for each result")
    add_corrections(parser, "SRC")
    add_robot_motion(parser, "SRC", fps="source-fps")
    add_corrections(parser, "TARGET", "to-")


def run(args: Namespace) -> int:
    from robots.formats import SUFFIXES, taken_files
    from robots.registry import is_robot
    from spark.errors import OutputError, SparkSimError
    from spark.summary import counted
    from spark_sim import character_files, console, files
    from spark_sim.commands.retarget_jobs import retarget_jobs
    from spark_sim.sources import sentences

    robot = is_robot(args.to) or Path(args.to).suffix.lower() in SUFFIXES or is_sonic(Path(args.to))
    if args.format is not None and not robot:
        raise OutputError(f"--format is for robots; {args.to} is a character")
    ending = FORMATS[args.format or "npz"] if robot else ".bvh"
    jobs, left_out = retarget_jobs(
        args.sources, Path(args.to), args.output, ending, robot=args.robot is not None
    )
    for sentence in sentences(left_out):
        console.note(sentence)
    written: list[Path] = []
    for _, out in jobs:
        written += taken_files(out, args.format) if robot else [out]
        if not robot:
            files.check_ending(out, character_files.ENDINGS, "a character's motion")
    for file in written:
        files.check_free(file, force=args.force)
    read = [*(source for source, _ in jobs), *map(Path, filter(None, (args.to, args.terrain)))]
    files.check_not_read(written, read)
    check_given(args, [source for source, _ in jobs], fps="source-fps")
    check_given(args, [args.to], "to-")
    target = load(args, args.to, "to-")
    failures = 0
    for source, out in console.progress(jobs, "retarget"):
        try:
            summary = _retarget(args, source, target, out)
        except (SparkSimError, OSError) as error:
            if len(jobs) == 1:
                raise
            failures += 1
            console.error(str(error))
            summary = {"source": str(source), "output": None, "error": str(error)}
        if args.json:
            console.emit_json(summary)
        elif summary["output"] is not None:
            console.say(
                "{output}: {length}, {fps:.6g} fps, {source_joints} -> {joints} joints, "
                "scaled by {scale:.3g}".format(
                    **summary, length=counted(summary["frames"], "frame")
                )
            )
    if failures:
        console.error(f"{failures} of {len(jobs)} motions could not be retargeted")
    return 2 if failures else 0


def _retarget(args: Namespace, source: Path, target: "AnyClip", out: Path) -> dict[str, Any]:
    from robots.formats import format_of, terrain_beside, unsaid
    from spark_sim import character_files, console
    from spark_sim.api import retarget
    from spark_sim.clips import Clip

    clip = _source(args, source)
    result = retarget(
        clip,
        target,
        method=args.method,
        checkpoint=args.checkpoint,
        refine=args.refine,
        keep_touches=args.keep_touches,
        terrain=args.terrain,
    )
    if isinstance(result, Clip):
        lacking = character_files.lacking(result.body_file, out)
        console.notes(out, [*result.recording.notes, *lacking])
        result.save(out, force=args.force)
    else:
        new = [note for note in result.notes if note not in target.notes]
        format = format_of(out, args.format)
        if result.terrain is not None and format != "npz":
            new.append(f"the ground is beside it, in metres, Z up: {terrain_beside(out).name}")
        console.notes(out, [*new, *unsaid(out, format, result.motion.fps)])
        result.save(out, force=args.force, format=args.format)
    method = args.method
    if not isinstance(result, Clip):
        method = "trajectory" if args.refine and args.method != "copy" else "copy"
    return {
        "source": str(source),
        "target": args.to,
        "output": str(out),
        "method": method,
        "frames": len(result.motion),
        "fps": result.motion.fps,
        "source_joints": len(clip.joint_names),
        "joints": len(result.joint_names),
        "scale": result.rig.hip_height / clip.rig.hip_height,
        "notes": [*clip.notes, *result.notes],
    }


def _source(args: Namespace, path: Path) -> "AnyClip":
    """The motion to retarget: of a file, the part of it that is wanted, at the rate that is wanted.

    Of a CSV whose rate nothing else says, `--fps` is the rate, and the result's too.
    """
    from robots.formats.sidecar import read_sidecar
    from spark_sim import console

    rate, is_csv = args.source_fps, path.suffix.lower() == ".csv"
    if is_csv and rate is None and args.fps is not None and "fps" not in (read_sidecar(path) or {}):
        rate = args.fps
        console.note(
            f"{path.name}: read at {rate:g} fps, as --fps says; --source-fps where it has another "
            "rate than the result"
        )
    clip = load(Namespace(**vars(args) | {"fps": rate}), str(path))
    if args.start is not None or args.end is not None:
        clip = clip.part(args.start, args.end)
    wanted = args.fps
    if wanted is None and args.format == "sonic":
        wanted = SONIC_FPS
        console.note(f"{path.name}: resampled to {wanted:g} fps, which SONIC plays")
    return clip if wanted is None else clip.resampled(wanted)
