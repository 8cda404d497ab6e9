"""`spark-sim play`: watch motions, in a window, a video, a web page or a picture."""

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from textwrap import fill
from typing import Any

from sim.view.timeline import SPEEDS
from spark_sim.commands.options import (
    add_corrections,
    add_force,
    add_json,
    add_robot_motion,
    check_given,
    load,
)

SUMMARY = "watch motions: window, video, web page, picture"
USAGE = "FILE... [--video MP4] [--html HTML] [--strip PNG]"
DESCRIPTION = """\
Show the motions of all FILEs side by side: characters with the skin of their
file, or on MuJoCo bodies made from their skeletons, robots on their own
models. This opens a window. With --video, --html, --strip, --gif or --webp it
writes files instead and needs no display.

With --physics, servos track each motion in simulation. A summary says whether
the body stays up, hangs on the assist or falls, how far it is from the motion,
and the torques. A controller looks ahead and keeps its balance, which takes
ten seconds and more for one of the motion; with --no-balance nothing does, and
with --assist a force on the root. With --policy and --spec a policy of yours
follows a robot's motion."""
EXAMPLES = """\
examples:
  spark-sim play walk.bvh              # a window
  spark-sim play walk.bvh walk_on_mutant.bvh --html both.html
  spark-sim play walk.bvh walk_on_g1.npz --video walk.mp4 --strip walk.png
  spark-sim play theirs.csv --robot unitree_g1 --quat xyzw --fps 60
  spark-sim play walk_on_g1.npz --physics --video physics.mp4
  spark-sim play walk_on_g1.npz --physics --assist --html physics.html
  spark-sim play walk_on_g1.npz --physics --policy my.onnx --spec my.toml
"""
_OUTPUTS = ("video", "html", "strip", "gif", "webp")
_SIMULATION = ("physics", "assist", "no_balance", "policy", "spec", "seeds")
_NOT_SERVED = (*_SIMULATION, "json", "mesh", "same_height")


def configure(parser: ArgumentParser) -> None:
    parser.add_argument(
        "files", metavar="FILE", nargs="*", help="a character's file, or a robot's motion"
    )
    parser.add_argument("--video", metavar="MP4", help="write a video")
    parser.add_argument("--html", metavar="HTML", help="write one web page with a 3D replay")
    parser.add_argument("--strip", metavar="PNG", help="write a strip of moments as one picture")
    parser.add_argument("--gif", metavar="GIF", help="write an animated picture, for a README")
    parser.add_argument("--webp", metavar="WEBP", help="write one that is smaller and finer")
    parser.add_argument(
        "--serve", action="store_true", help="serve a page in a browser, to drop files on"
    )
    parser.add_argument(
        "--address",
        metavar="HOST:PORT",
        help="with --serve: where (localhost:8765; other machines reach 0.0.0.0:8765)",
    )
    parser.add_argument(
        "--same-height", action="store_true", help="show all figures as tall as the tallest"
    )
    parser.add_argument(
        "--speed",
        metavar="X",
        type=float,
        choices=SPEEDS,
        default=1.0,
        help="0.1, 0.25, 0.5, 1 (default), 1.5, 2 or 4; at 0.25 a video is in slow motion, with "
        "frames made between the motion's",
    )
    parser.add_argument(
        "--mesh",
        metavar="FILE",
        action="append",
        default=[],
        help="show a character with the skin of this file (.glb, .gltf, .vrm, .fbx), on the same "
        "joints",
    )
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
    parser.add_argument(
        "--no-balance",
        action="store_true",
        help="with --physics: servos alone, which are quick and let walks fall",
    )
    parser.add_argument(
        "--policy", metavar="ONNX", help="with --physics: follow a robot's motion with this policy"
    )
    parser.add_argument(
        "--spec",
        metavar="TOML",
        help="what the policy sees, its joints, gains and rate: docs/policies.md",
    )
    parser.add_argument(
        "--seeds", metavar="N", type=_count, help="runs of the policy (3), each begun a little off"
    )
    add_json(parser, "the summary of --physics")
    add_force(parser)
    add_corrections(parser, "every FILE")
    add_robot_motion(parser, "every FILE")


def run(args: Namespace) -> int:
    from spark_sim import console

    outputs = {name: getattr(args, name) for name in _OUTPUTS}
    wanted = {name: Path(path) for name, path in outputs.items() if path is not None}
    _check(args, wanted)
    if args.serve:
        return _serve(args)
    shown: list[Any] = [load(args, path) for path in args.files]
    if args.mesh:
        from spark_sim.loading import dressed

        shown = dressed(shown, args.mesh)
    visible = bool(wanted) or not args.json
    if visible:
        for path, clip in zip(args.files, shown, strict=True):
            console.notes(path, clip.surface[1])
    if args.physics:
        shown = _simulated(args, shown)
    if visible:
        _show(args, shown, wanted)
    for out in wanted.values():
        size = f"{out}: {out.stat().st_size / 1000:.0f} kB"
        console.note(size) if args.json else console.say(size)
    return 0


def _check(args: Namespace, wanted: Mapping[str, Path]) -> None:
    """Raise `ConventionError` for options that don't go together."""
    from spark.errors import ConventionError

    check_given(args, args.files)
    if args.serve:
        given = [*wanted, *(name for name in _NOT_SERVED if getattr(args, name))]
        given += ["speed"] * (args.speed != 1.0)
        if given:
            other = given[0].replace("_", "-")
            raise ConventionError(f"--serve shows a page in a browser; --{other} goes without it")
        return
    if args.address:
        raise ConventionError("--address goes with --serve")
    if not args.files:
        raise ConventionError("no FILE is given; only --serve needs none")
    if not args.physics and (args.assist or args.no_balance or args.json):
        raise ConventionError("--assist, --no-balance and --json go with --physics")
    if (args.policy is None) != (args.spec is None) or (args.policy and not args.physics):
        raise ConventionError("--policy FILE.onnx goes with --physics and --spec FILE.toml")
    if args.speed != 1.0 and [*wanted] == ["strip"]:
        raise ConventionError("--speed does not go with --strip, a picture that stands still")
    if args.policy and (args.assist or args.no_balance):
        raise ConventionError("--policy holds the body up; --assist and --no-balance go without it")
    if args.seeds and not args.policy:
        raise ConventionError("--seeds goes with --policy")


def _show(args: Namespace, shown: list[Any], wanted: Mapping[str, Path]) -> None:
    """In a window, or as the files that are wanted."""
    from spark.errors import DependencyError
    from spark_sim import api, console

    try:
        api.play(
            *shown,
            **wanted,
            same_height=args.same_height,
            speed=args.speed,
            force=args.force,
            progress=partial(console.progress, label="video"),
        )
    except DependencyError:
        if wanted or not args.physics:
            raise
        # The report is the result, and is printed: that no window opens is no failure.
        console.note(
            "there is no display to show it on; --html out.html or --video out.mp4 writes what "
            "there is to see"
        )


def _simulated(args: Namespace, clips: list[Any]) -> list[Any]:
    """The clips as they come out of the simulation; the report is printed."""
    from spark_sim import console
    from spark_sim.simulation import follow

    made: list[Any]
    if args.policy is None:
        made = [_tracked(args, each) for each in clips]
    else:
        seeds = args.seeds or 3
        made = [follow(each, args.policy, args.spec, seeds=seeds) for each in clips]
    for path, each in zip(args.files, made, strict=True):
        console.notes(path, each.notes)
    if args.json:
        for each in made:
            console.emit_json(each.json())
    else:
        cautions = {each.json()["limits"]: None for each in made} if args.policy is None else {}
        said = [*(each.text() for each in made), *(fill(each, 79) for each in cautions)]
        console.say("\n\n".join(said))
    return made


def _tracked(args: Namespace, clip: Any) -> Any:
    """A clip followed by servos."""
    from spark_sim import console
    from spark_sim.simulation import simulate

    with console.meter(len(clip.motion), 0, "simulation") as tell:

        def progress(frame: int) -> None:
            tell(frame + 1, {})

        balance = not (args.assist or args.no_balance)
        return simulate(clip, assist=args.assist, balance=balance, progress=progress)


def _count(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 1000:
        raise ArgumentTypeError(f"{text!r} is no number of runs; expected 1 to 1000")
    return int(text)


def _serve(args: Namespace) -> int:
    from spark_sim import console
    from spark_sim.commands.studio import address, serve

    host, port = address(args.address or "localhost:8765")
    clips = [load(args, path) for path in args.files]
    serve(host, port, clips, lambda url: console.say(f"{url}  (Ctrl-C ends it)"))
    return 0
