"""`spark-sim train`: a network of your own."""

import os
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from spark.training.settings import TrainConfig
    from spark.training.train import Watch

SUMMARY = "train the network that retargets"
USAGE = "DATA... -o DIR [--config TOML] [--resume] [options]"
DESCRIPTION = """\
Train a network on each DATA: a dataset that `spark-sim prepare` made, or a
folder of motions. Writes DIR/checkpoint.safetensors, the settings to
DIR/config.toml, and the losses of each step to DIR/log.jsonl."""
EXAMPLES = """\
examples:
  spark-sim train motions/ -o run --preset tiny
  spark-sim train motions/ -o run --config run.toml --steps 20000
  spark-sim train -o run --resume      # goes on where run stopped
  torchrun --nproc-per-node 4 -m spark_sim train motions/ -o run
"""
_FLAGS = {
    "steps": "number of training steps",
    "batch": "windows in one step",
    "window": "frames in one window",
    "rate": "learning rate",
    "seed": "seed of all that is drawn",
    "workers": "processes that load data",
}
# What the weights in a checkpoint were made for.
_OF_THE_NETWORK = ("preset", "ablate", "width", "heads", "blocks", "names", "t5")


def configure(parser: ArgumentParser) -> None:
    parser.add_argument("data", metavar="DATA", nargs="*", help="datasets, or folders of files")
    parser.add_argument(
        "-o", "--output", metavar="DIR", required=True, help="the folder of the run"
    )
    parser.add_argument("--config", metavar="TOML", help="read the settings from this file")
    parser.add_argument("--resume", action="store_true", help="continue from the checkpoint in DIR")
    parser.add_argument(
        "--preset", metavar="NAME", help="the settings to start from: default, paper or tiny"
    )
    parser.add_argument(
        "--ablate",
        metavar="SWITCH",
        action="append",
        help="leave out share, mask or fk, switch pos, or mix motions; may be given several times",
    )
    for name, what in _FLAGS.items():
        number = float if name == "rate" else int
        parser.add_argument(f"--{name}", metavar="N", type=number, help=what)
    parser.add_argument(
        "--names", metavar="FILE", help="an encoder of joint names that was trained before"
    )
    parser.add_argument(
        "--t5", metavar="MODEL", help="encode joint names with a T5: a folder, or a name on the hub"
    )
    parser.add_argument(
        "--tensorboard", action="store_true", help="also write logs for TensorBoard into DIR"
    )
    parser.add_argument("--force", action="store_true", help="overwrite the run in DIR")


def run(args: Namespace) -> int:
    from spark.errors import ConventionError, DependencyError, OutputError
    from spark.files import write_atomically
    from spark.training.settings import TrainConfig, read_settings, toml
    from spark_sim import console

    out = Path(args.output)
    path = out / "checkpoint.safetensors"
    if args.resume and args.config:
        raise ConventionError("--resume takes its settings from DIR/config.toml, not from --config")
    if args.resume and not path.exists():
        raise OutputError(f"{path}: no such file, so there is no run to resume")
    file = out / "config.toml" if args.resume else args.config and Path(args.config)
    given = {n: getattr(args, n) for n in (*_FLAGS, "preset", "ablate", "names", "t5")}
    given = {n: v for n, v in given.items() if v is not None} | (
        {"data": args.data} if args.data else {}
    )
    stored = read_settings(file) if file else {}
    preset = given.get("preset", stored.get("preset", "default"))
    config = TrainConfig.of(preset).changed(file, **stored).changed("command line", **given)
    if not config.data:
        raise ConventionError("no DATA to train on; expected datasets or folders of motion files")
    if path.exists() and not (args.resume or args.force):
        raise OutputError(f"{path}: exists; go on with --resume, or overwrite it with --force")
    try:
        from spark.training.checkpoint import load_checkpoint
        from spark.training.dataset import training_clips
        from spark.training.train import fresh_checkpoint, train
    except ImportError as error:
        raise DependencyError(
            f"training needs {error.name}: pip install 'spark-sim[train]'"
        ) from error
    if args.tensorboard:
        try:
            import torch.utils.tensorboard  # noqa: F401  # before minutes of work, not after
        except ImportError as error:
            raise DependencyError(
                f"--tensorboard needs {error.name}: pip install 'spark-sim[tensorboard]'"
            ) from error
    start = load_checkpoint(path) if args.resume else None
    if start:
        _check_same_network(path, start.settings, config)
    clips, notes = training_clips(
        [Path(p) for p in config.data], lambda files: console.progress(files, "reading")
    )
    for note in notes:
        console.note(note)
    start = start or fresh_checkpoint(config)
    out.mkdir(parents=True, exist_ok=True)
    write_atomically(out / "config.toml", toml(config).encode())
    with (
        _board(out, start.step, args.tensorboard) as board,
        console.meter(config.steps, start.step, "training") as tell,
    ):

        def watch(step: int, terms: dict[str, float]) -> None:
            board(step, terms)
            tell(step, terms)

        done = train(clips, config, out, start=start, watch=watch)
    if _is_first():
        console.say(f"{path}: {done.step} steps on {len(clips)} clips")
    return 0


def _is_first() -> bool:
    """Whether this process is the only one, or the one of `torchrun`'s that writes."""
    return os.environ.get("RANK", "0") == "0"


def _check_same_network(path: Path, trained: Mapping[str, object], config: "TrainConfig") -> None:
    """Raise `ConventionError` where a resumed run is asked for another network than it has."""
    from spark.errors import ConventionError

    for name in _OF_THE_NETWORK:
        before, now = trained.get(name), getattr(config, name)
        before = tuple(before) if isinstance(before, list) else before
        if name in trained and before != now:
            raise ConventionError(
                f"{path}: was trained with {name} = {before!r}, not {now!r}; --resume goes on with "
                "the network that is there"
            )


@contextmanager
def _board(out: Path, step: int, wanted: bool) -> "Iterator[Watch]":
    """What writes loss terms for TensorBoard, from `step` on; under `torchrun` one process does."""
    if not (wanted and _is_first()):
        yield lambda step, terms: None
        return
    from torch.utils.tensorboard import SummaryWriter

    with SummaryWriter(str(out), purge_step=step + 1) as writer:

        def tell(step: int, terms: dict[str, float]) -> None:
            for name, value in terms.items():
                writer.add_scalar(name, value, step)

        yield tell
