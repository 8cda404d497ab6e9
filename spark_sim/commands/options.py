"""Options that several commands share."""

import os
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from spark_sim.choices import Quat

if TYPE_CHECKING:
    from spark_sim.clips import AnyClip


def add_corrections(parser: ArgumentParser, file: str, prefix: str = "") -> None:
    """`--unit`, `--up` and `--map`: what the user corrects of what is inferred from `file`.

    A file that comes with the option `--NAME` has `--NAME-unit`, `--NAME-up` and `--NAME-map`.
    """
    dest = prefix.replace("-", "_")
    group = parser.add_argument_group(f"corrections for {file} (what is not given is inferred)")
    group.add_argument(
        f"--{prefix}unit",
        dest=f"{dest}unit",
        metavar="UNIT",
        help="m, dm, cm, mm, inch, ft, cmu (5.644 cm), or metres as a number",
    )
    group.add_argument(
        f"--{prefix}up",
        dest=f"{dest}up",
        metavar="AXIS",
        help=f"the axis that points up: x, y or z; --{prefix}up=-y where y points down",
    )
    group.add_argument(
        f"--{prefix}map",
        dest=f"{dest}map",
        metavar="TOML",
        help="which joint is what, as `spark-sim inspect --save-map` writes it",
    )
    group.add_argument(
        f"--{prefix}clip",
        dest=f"{dest}clip",
        metavar="NAME",
        help="which of several animations in a glTF or FBX file",
    )
    if prefix != "to-":  # a target is a character's file
        group.add_argument(
            f"--{prefix}body-model",
            dest=f"{dest}body_model",
            metavar="NPZ",
            help="your own SMPL, SMPL-H or SMPL-X file, for the exact bones of a motion of that "
            "family",
        )


def add_robot_motion(
    parser: ArgumentParser, file: str, prefix: str = "", *, fps: str | None = None
) -> None:
    """`--robot`, `--quat` and `--fps`: what `file` doesn't say where it is a robot's own motion.

    A file that comes with the option `--NAME` has `--NAME-robot`, `--NAME-quat`, `--NAME-fps`;
    `fps` is another name for the last one.
    """
    rate = fps or f"{prefix}fps"
    dest = prefix.replace("-", "_")
    group = parser.add_argument_group(f"for {file} of a robot (.npz, .csv, .pkl, ...)")
    group.add_argument(
        f"--{prefix}robot",
        dest=f"{dest}robot",
        metavar="ROBOT",
        help="the robot that moves: a name (`spark-sim robots`) or an MJCF file; the .npz that "
        "spark-sim writes says it",
    )
    group.add_argument(
        f"--{prefix}quat",
        dest=f"{dest}quat",
        choices=get_args(Quat),
        help="order of the quaternions in a CSV; Unitree writes xyzw",
    )
    group.add_argument(
        f"--{rate}",
        dest=rate.replace("-", "_"),
        metavar="N",
        type=float,
        help="frame rate of a CSV, or of any motion whose file says none",
    )


_READING = ("unit", "up", "roles", "body_model", "clip", "robot", "quat", "fps")


def given(args: Namespace, prefix: str = "", *, fps: str | None = None) -> dict[str, Any]:
    """What the user says of the files that options with this prefix are for, as `load` of
    `spark_sim` takes it. `fps` is another name for the option of their rate."""
    options = _options(prefix, fps)
    values = {name: vars(args).get(option.replace("-", "_")) for name, option in options.items()}
    return {name: value for name, value in values.items() if value is not None}


def _options(prefix: str, fps: str | None) -> dict[str, str]:
    """The option for each thing that `load` of `spark_sim` takes."""
    of = {name: prefix + name.replace("_", "-") for name in _READING}
    return of | {"roles": f"{prefix}map", "fps": fps or of["fps"]}


def check_given(
    args: Namespace, files: "Sequence[str | Path]", prefix: str = "", *, fps: str | None = None
) -> None:
    """Raise `ConventionError` where an option with this prefix goes with none of the `files` that
    it is for; say which ones it is left out for, where it goes with others."""
    from spark.errors import ConventionError, name_list
    from spark_sim import console

    for name in given(args, prefix, fps=fps):
        option = f"--{_options(prefix, fps)[name]}"
        others = [str(file) for file in files if not _may_take(file, name)]
        if not files:
            raise ConventionError(f"{option}: there is no file that it is for; leave it out")
        if len(others) == len(files):
            raise ConventionError(f"{option} does not go with {name_list(others)}; leave it out")
        if others:
            console.note(f"{option} is left out for {name_list(others)}, which it does not go with")


def _may_take(file: "str | Path", name: str) -> bool:
    """Whether `load` takes this of a file; also where it will say that the file can't be read."""
    from spark.errors import SparkSimError
    from spark_sim.loading import takes

    try:
        return name in takes(file)
    except (SparkSimError, OSError):
        return True


def load(args: Namespace, path: str, prefix: str = "", *, humanoid: bool = True) -> "AnyClip":
    """The clip of `path`, read with the corrections given; its notes go to stderr.

    Options go to the kinds of file that they are for, so that one command takes several kinds:
    `check_given` comes first. Raises `SkeletonError` where the body is no `humanoid` and must be
    one.
    """
    from spark.errors import SkeletonError
    from spark_sim import console, loading
    from spark_sim.clips import Clip

    taken = loading.takes(path)
    wanted = {name: value for name, value in given(args, prefix).items() if name in taken}
    loaded = loading.load(path, **wanted)
    try:
        console.notes(path, loaded.notes)
    except SkeletonError:
        if humanoid or not isinstance(loaded, Clip):
            raise
        console.notes(path, loaded.recording.notes)
    return loaded


def add_force(parser: ArgumentParser) -> None:
    """`--force`: nothing is overwritten without it."""
    parser.add_argument("--force", action="store_true", help="overwrite files that exist")


def add_json(parser: ArgumentParser, what: str) -> None:
    """`--json`: the result for scripts."""
    parser.add_argument("--json", action="store_true", help=f"print {what} as JSON")


def add_workers(parser: ArgumentParser) -> None:
    """`--workers`: how many processes share the work."""
    parser.add_argument(
        "--workers",
        metavar="N",
        type=int,
        help="number of processes for many files (default: one a core)",
    )


def workers(args: Namespace) -> int:
    """How many processes to start."""
    from spark.errors import ConventionError

    count = len(os.sched_getaffinity(0)) if args.workers is None else int(args.workers)
    if count < 1:
        raise ConventionError(f"--workers {count}: expected 1 or more")
    return count
