"""`spark-sim retarget`: motions onto another body."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spark_sim.commands.options import add_corrections, add_force, add_json, load

if TYPE_CHECKING:
    from spark_sim.clip import Clip

SUMMARY = "put motions on another body"
USAGE = "SRC... --to TARGET [-o OUT] [options]"
DESCRIPTION = """\
Put the motion of each SRC on the body of TARGET. Both may be any humanoid rig:
joints are matched by what they are, not by name or order, and rest poses,
axes, units and proportions may differ. The result is a BVH in TARGET's own
hierarchy, channels, unit and axes."""
EXAMPLES = """\
examples:
  spark-sim retarget walk.bvh --to mutant.bvh       # writes walk_on_mutant.bvh
  spark-sim retarget walk.bvh --to mutant.bvh -o out.bvh
  spark-sim retarget takes/ --to mutant.bvh -o out/ # every file below takes/
  spark-sim retarget walk.bvh --to g1.xml           # a robot: walk_on_g1.npz
"""


def configure(parser: ArgumentParser) -> None:
    parser.add_argument("sources", metavar="SRC", nargs="+", help="BVH or FBX files, or folders")
    parser.add_argument(
        "--to",
        metavar="TARGET",
        required=True,
        help="the body to put the motion on: a BVH or FBX file, or a humanoid robot's MJCF (.xml)",
    )
    parser.add_argument(
        "-o",
        "--output",
        metavar="OUT",
        help="the file to write; a folder for several motions "
        "(default: SRC_on_TARGET.bvh in the current folder)",
    )
    parser.add_argument(
        "--method",
        choices=("copy", "spark"),
        default="copy",
        help="copy: each joint turns as its counterpart does, in world axes (default); "
        "spark: the network of --checkpoint",
    )
    parser.add_argument("--checkpoint", metavar="FILE", help="what `spark-sim train` wrote")
    parser.add_argument(
        "--no-refine",
        dest="refine",
        action="store_false",
        help="leave the feet as the method puts them, instead of holding them where SRC's stand",
    )
    add_force(parser)
    add_json(parser, "one line for each result")
    add_corrections(parser, "SRC")
    add_corrections(parser, "TARGET", "to-")


def run(args: Namespace) -> int:
    from spark.errors import SparkSimError
    from spark_sim import console, files

    jobs = _jobs(args.sources, Path(args.to), args.output)
    for _, out in jobs:
        files.check_free(out, force=args.force)
    robot = Path(args.to).suffix.lower() == ".xml"
    onto = _robot(args) if robot else _body(args)
    failures = 0
    for source, out in console.progress(jobs, "retarget"):
        try:
            summary = onto(source, out)
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
                "{output}: {frames} frames, {fps:.6g} fps, {source_joints} -> {joints} joints, "
                "size x {scale:.3g}".format(**summary)
            )
    if failures:
        console.error(f"{failures} of {len(jobs)} motions could not be retargeted")
    return 2 if failures else 0


Onto = Callable[[Path, Path], dict[str, Any]]


def _body(args: Namespace) -> Onto:
    """Onto a character: the target is read once."""
    target = load(args, args.to, "to-")
    return lambda source, out: _retarget(args, source, target, out)


def _robot(args: Namespace) -> Onto:
    """Onto a robot: what its model is is found once."""
    from spark_sim import console
    from spark_sim.robot import load_robot, retarget_to_robot, save

    robot = load_robot(args.to)
    console.notes(args.to, robot.notes)

    def onto(source: Path, out: Path) -> dict[str, Any]:
        clip = load(args, str(source))
        result = retarget_to_robot(clip, robot)
        save(result, out, force=args.force)
        return {
            "source": str(source),
            "target": args.to,
            "output": str(out),
            "method": "trajectory",
            "frames": len(result),
            "fps": clip.motion.fps,
            "source_joints": len(clip.motion.skeleton),
            "joints": len(robot.joint_names),
            "scale": robot.rig.hip_height / clip.rig.hip_height,
            "notes": [*clip.notes, *result.notes],
        }

    return onto


def _retarget(args: Namespace, source: Path, target: "Clip", out: Path) -> dict[str, Any]:
    from spark_sim import console
    from spark_sim.clip import retarget

    clip = load(args, str(source))
    result = retarget(
        clip, target, method=args.method, checkpoint=args.checkpoint, refine=args.refine
    )
    console.notes(out, result.recording.notes)
    result.save(out, force=args.force)
    return {
        "source": str(source),
        "target": args.to,
        "output": str(out),
        "method": args.method,
        "frames": len(result.motion),
        "fps": result.motion.fps,
        "source_joints": len(clip.motion.skeleton),
        "joints": len(result.motion.skeleton),
        "scale": result.rig.hip_height / clip.rig.hip_height,
        "notes": [*clip.notes, *result.notes],
    }


def _jobs(sources: Sequence[str], target: Path, output: str | None) -> list[tuple[Path, Path]]:
    """Pairs of a file to read and the file to write. Raises `OutputError` where two would collide.

    Below a folder given as a source the tree of folders is kept.
    """
    from spark.errors import OutputError
    from spark.reading import motion_files

    found: list[tuple[Path, Path]] = []
    for source in map(Path, sources):
        if source.is_dir():
            found += [(path, path.parent.relative_to(source)) for path in motion_files(source)]
        else:
            found.append((source, Path()))
    several = len(found) > 1 or any(Path(source).is_dir() for source in sources)
    if output is not None and not several and not _names_folder(output):
        return [(found[0][0], Path(output))]
    folder = Path(output or ".")
    if folder.is_file():
        raise OutputError(f"{folder}: is a file; expected a folder for {len(found)} motions")
    suffix = ".npz" if target.suffix.lower() == ".xml" else ".bvh"
    made = f"_on_{target.stem}{suffix}"
    jobs = [(path, folder / below / f"{path.stem}{made}") for path, below in found]
    outputs: dict[Path, Path] = {}
    for path, out in jobs:
        other = outputs.setdefault(out, path)
        if other != path:
            raise OutputError(f"{path} and {other} would both be written to {out}; rename one")
    return jobs


def _names_folder(output: str) -> bool:
    return output.endswith("/") or Path(output).is_dir()
