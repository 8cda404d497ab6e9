"""`spark-sim train`: a network of your own."""

import shlex
from argparse import ArgumentParser, BooleanOptionalAction, Namespace
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from spark.training.checkpoint import Checkpoint
    from spark.training.cuts import TrainingClip
    from spark.training.settings import TrainConfig

SUMMARY = "train the network that retargets"
USAGE = "DATA... -o DIR [--config TOML] [--resume] [options]"
DESCRIPTION = """\
Train a network on each DATA: a dataset that `spark-sim prepare` made, or a
folder of motions. Writes DIR/checkpoint.safetensors, the settings to
DIR/config.toml, the losses to DIR/log.jsonl, and a plot of them to
DIR/losses.png.

Ctrl-C ends the run after the step at work, which is saved; --resume goes on
as if the run had never stopped. A second Ctrl-C ends it at once."""
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
    "workers": "processes that make batches (default: 8 for a GPU, else none)",
}


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
        "--compile",
        action=BooleanOptionalAction,
        help="compile the network, or don't (default: on a GPU, for runs of half an hour or more)",
    )
    parser.add_argument(
        "--names",
        metavar="FILE",
        help="another encoder of joint names than the one that ships: a file of "
        "scripts/train_names.py, a checkpoint, or the folder of a run",
    )
    parser.add_argument(
        "--t5", metavar="MODEL", help="encode joint names with a T5: a folder, or a name on the hub"
    )
    parser.add_argument(
        "--tensorboard", action="store_true", help="also write logs for TensorBoard into DIR"
    )
    parser.add_argument("--force", action="store_true", help="overwrite the run in DIR")


def run(args: Namespace) -> int:
    from spark_sim import console
    from spark_sim.commands.train_start import fresh, hold, learn_recorded, resumed
    from spark_sim.watching import is_first

    out = Path(args.output)
    config = _config(args, out)
    if is_first():
        console.note(
            f"{out}: preset {config.preset}, {config.steps} steps of {config.batch} windows, on "
            f"{', '.join(config.data)}; loading torch"
        )
    _check_installed(args.tensorboard)
    threads = _set_threads(config)
    with ExitStack() as held:
        if args.resume:
            hold(out, held)  # before what another run may yet write is read
            start = resumed(out, config)
            clips = _clips(config, threads)
        else:
            clips = _clips(config, threads)
            start = fresh(config)
            hold(out, held)
        _write_settings(config, out)
        if not start.step and not start.recorded:
            start = learn_recorded(start, config, out)
        return _steps(clips, config, out, start, board=args.tensorboard)


def _config(args: Namespace, out: Path) -> "TrainConfig":
    """The settings of the run, those of the command line over those of a file over the preset's.

    Raises `ConventionError` for what does not go together, `OutputError` where there is a run in
    `out` already, or none to resume."""
    from spark.errors import ConventionError, OutputError
    from spark.training.settings import TrainConfig, read_settings

    path = out / "checkpoint.safetensors"
    if args.resume and args.config:
        raise ConventionError("--resume takes its settings from DIR/config.toml, not from --config")
    if args.resume and not path.exists():
        raise OutputError(f"{path}: no such file, so there is no run to resume")
    file = out / "config.toml" if args.resume else args.config and Path(args.config)
    compiled = {None: None, True: "on", False: "off"}[args.compile]
    given = {n: getattr(args, n) for n in (*_FLAGS, "preset", "ablate", "names", "t5")}
    given |= {"compile": compiled, "data": args.data or None}
    given = {n: v for n, v in given.items() if v is not None}
    stored = read_settings(file) if file else {}
    preset = given.get("preset", stored.get("preset", "default"))
    config = TrainConfig.of(preset).changed(file, **stored).changed("command line", **given)
    if not config.data:
        raise ConventionError("no DATA to train on; expected datasets or folders of motion files")
    if path.exists() and not (args.resume or args.force):
        raise OutputError(f"{path}: exists; go on with --resume, or overwrite it with --force")
    return config


def _check_installed(board: bool) -> None:
    """Raise `DependencyError` before minutes of work, not after."""
    from spark.errors import DependencyError

    Path.cwd()  # raises where it was deleted: there torch's oneMKL would end the process
    try:
        import spark.training.train  # noqa: F401
    except ImportError as error:
        raise DependencyError(
            f"training needs {error.name}: pip install 'spark-sim[train]'"
        ) from error
    if board:
        try:
            import torch.utils.tensorboard  # noqa: F401
        except ImportError as error:
            raise DependencyError(
                f"--tensorboard needs {error.name}: pip install 'spark-sim[tensorboard]'"
            ) from error


def _set_threads(config: "TrainConfig") -> int | None:
    """The number of threads that is chosen; None where the environment says it. Raises
    `ConventionError` where a step has too few windows for the processes of `torchrun`."""
    import torch

    from spark.training.processes import check_shares, process_count
    from spark.training.threads import choose_threads

    check_shares(config.draws, process_count())
    threads = choose_threads(config.width)
    if threads:
        torch.set_num_threads(threads)
    return threads


def _clips(config: "TrainConfig", threads: int | None) -> "list[TrainingClip]":
    """What is trained on, read and counted."""
    from spark.training.dataset import training_clips
    from spark_sim import console
    from spark_sim.watching import is_first

    clips, notes = training_clips(
        [Path(p) for p in config.data],
        lambda files: console.progress(files, "reading", lines=is_first()),
    )
    if is_first():
        for note in notes:
            console.note(note)
        console.note(
            f"{len(clips)} clips of {len({id(clip.body) for clip in clips})} bodies, "
            f"{sum(len(clip.hips) * clip.frame_time for clip in clips) / 60:.3g} minutes; "
            f"on {_device(threads)}"
        )
    return clips


def _write_settings(config: "TrainConfig", out: Path) -> None:
    from spark.files import write_atomically
    from spark.training.settings import toml

    write_atomically(out / "config.toml", toml(config).encode())


def _steps(
    clips: "list[TrainingClip]",
    config: "TrainConfig",
    out: Path,
    start: "Checkpoint",
    *,
    board: bool,
) -> int:
    """Train, and return the exit code: 128 and the signal's number where a signal ended it."""
    from spark.training.train import train
    from spark_sim import console
    from spark_sim.stopping import asked_to_stop
    from spark_sim.watching import is_first, watching

    if is_first():
        console.note(f"training: {start.step} of {config.steps}; the first step takes longest")
    with (
        asked_to_stop(_say_stopping) as asked,
        watching(out, start.step, config.steps, board=board) as watch,
    ):
        done = train(clips, config, out, start=start, watch=watch, stop=lambda: asked() > 0)
        by_signal = asked()
    if is_first():
        path = out / "checkpoint.safetensors"
        console.say(f"{path}: {done.step} steps on {len(clips)} clips")
        if done.step < config.steps:
            console.note(
                f"stopped at step {done.step} of {config.steps}, which is saved; go on with: "
                f"spark-sim train -o {shlex.quote(str(out))} --resume"
            )
    return 128 + by_signal if done.step < config.steps else 0


def _device(threads: int | None) -> str:
    """Where this process computes."""
    import torch

    if torch.cuda.is_available():
        return torch.cuda.get_device_name()
    count = torch.get_num_threads()
    chosen = "OMP_NUM_THREADS would set another number" if threads else "as the environment says"
    return f"the CPU with {count} thread{'s' * (count > 1)} ({chosen})"


def _say_stopping() -> None:
    from spark_sim import console

    console.note("stopping after this step, which is saved; once more ends at once, unsaved")
