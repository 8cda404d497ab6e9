"""Options that several commands share."""

from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from spark_sim.clip import Clip


def add_corrections(parser: ArgumentParser, file: str, prefix: str = "") -> None:
    """`--unit`, `--up` and `--map`: what the user knows better of `file` than we infer.

    A file that comes with the option `--NAME` has `--NAME-unit`, `--NAME-up` and `--NAME-map`.
    """
    dest = prefix.replace("-", "_")
    group = parser.add_argument_group(f"corrections for {file} (all is inferred where not given)")
    group.add_argument(
        f"--{prefix}unit",
        dest=f"{dest}unit",
        metavar="UNIT",
        help="m, dm, cm, mm, inch, cmu (5.644 cm), or metres as a number",
    )
    group.add_argument(
        f"--{prefix}up", dest=f"{dest}up", metavar="AXIS", help="axis that points up: x, y or z"
    )
    group.add_argument(
        f"--{prefix}map",
        dest=f"{dest}map",
        metavar="TOML",
        help="which joint is what, as `spark-sim inspect --save-map` writes it",
    )


def load(args: Namespace, path: str, prefix: str = "", *, humanoid: bool = True) -> "Clip":
    """The clip of `path`, read with the corrections given; its notes go to stderr.

    Raises `SkeletonError` where the body is no `humanoid` and must be one.
    """
    from spark_sim import clip, console

    given: dict[str, Any] = vars(args)
    dest = prefix.replace("-", "_")
    loaded = clip.load(
        path, unit=given[f"{dest}unit"], up=given[f"{dest}up"], roles=given[f"{dest}map"]
    )
    console.notes(path, loaded.notes if humanoid else loaded.recording.notes)
    return loaded


def add_force(parser: ArgumentParser) -> None:
    """`--force`: nothing is overwritten without it."""
    parser.add_argument("--force", action="store_true", help="overwrite what exists")


def add_json(parser: ArgumentParser, what: str) -> None:
    """`--json`: the result for scripts."""
    parser.add_argument("--json", action="store_true", help=f"print {what} as JSON")
