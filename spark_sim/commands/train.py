"""`spark-sim train`: a network of your own."""

import shlex
from argparse import ArgumentParser, BooleanOptionalAction, Namespace
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from spark.training.checkpoint import Checkpoint
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
    with ExitStack() as held:
        return _run(args, held)


def _run(args: Namespace, held: ExitStack) -> int:
    from spark.errors import ConventionError, DependencyError, OutputError
    from spark.files import write_atomically
    from spark.training.settings import TrainConfig, read_settings, toml
    from spark_sim import console
    from spark_sim.stopping import asked_to_stop
    from spark_sim.watching import is_first, watching, watching_stage

    out = Path(args.output)
    path = out / "checkpoint.safetensors"
    if args.resume and args.config:
        raise ConventionError("--resume takes its settings from DIR/config.toml, not from --config")
    if args.resume and not path.exists():
        raise OutputError(f"{path}: no such file, so there is no run to resume")
    file = out / "config.toml" if args.resume else args.config and Path(args.config)
    given = {n: getattr(args, n) for n in (*_FLAGS, "preset", "ablate", "names", "t5")}
    if args.compile is not None:
        given["compile"] = "on" if args.compile else "off"
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
    if is_first():
        console.note(
            f"{out}: preset {config.preset}, {config.steps} steps of {config.batch} windows, on "
            f"{', '.join(config.data)}; loading torch"
        )
    Path.cwd()  # raises where it was deleted: there torch's oneMKL would end the process
    try:
        import torch

        from spark.training.checkpoint import load_checkpoint
        from spark.training.dataset import training_clips
        from spark.training.processes import check_shares, process_count
        from spark.training.threads import choose_threads
        from spark.training.train import fresh_checkpoint, train
    except ImportError as error:
        raise DependencyError(
            f"training needs {error.name}: pip install 'spark-sim[train]'"
        ) from error
    if args.tensorboard:
        try:
            import torch.utils.tensorboard  # before minutes of work, not after
        except ImportError as error:
            raise DependencyError(
                f"--tensorboard needs {error.name}: pip install 'spark-sim[tensorboard]'"
            ) from error
    check_shares(config.draws, process_count())  # before minutes of work, too
    threads = choose_threads(config.width)
    if threads:
        torch.set_num_threads(threads)
    if args.resume:
        _hold(out, held)  # before what another run may yet write is read
    start = load_checkpoint(path) if args.resume else None
    if start and start.step and not start.optimizer:
        raise OutputError(
            f"{path}: optimizer-{start.step}.safetensors is not beside it, and without it a run "
            "can't go on as it was; put it back, or start anew with --force"
        )
    if start:
        _check_same_network(path, start.settings, config)
        if start.step > config.steps:
            raise ConventionError(
                f"--steps {config.steps}: the run in {out} is at step {start.step} already"
            )
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
    if start is None:
        name_steps = 0 if config.names or config.t5 else config.name_steps
        with watching_stage("learning names", name_steps) as watch_names:
            start = fresh_checkpoint(config, watch_names)
    if not args.resume:
        _hold(out, held)
    write_atomically(out / "config.toml", toml(config).encode())
    if not start.step and not start.recorded:
        start = _learn_recorded(start, config, out)
    if is_first():
        console.note(f"training: {start.step} of {config.steps}; the first step takes longest")
    with (
        asked_to_stop(_say_stopping) as asked,
        watching(out, start.step, config.steps, board=args.tensorboard) as watch,
    ):
        done = train(clips, config, out, start=start, watch=watch, stop=lambda: asked() > 0)
        by_signal = asked()
    if is_first():
        console.say(f"{path}: {done.step} steps on {len(clips)} clips")
        if done.step < config.steps:
            console.note(
                f"stopped at step {done.step} of {config.steps}, which is saved; go on with: "
                f"spark-sim train -o {shlex.quote(str(out))} --resume"
            )
    return 128 + by_signal if done.step < config.steps else 0


def _hold(out: Path, held: ExitStack) -> None:
    """Make the folder of the run, and keep other runs out of it. Under `torchrun` the process that
    writes does. Raises `OutputError` where another run is in it."""
    from spark_sim.files import one_run
    from spark_sim.watching import is_first

    if is_first():
        held.enter_context(one_run(out))
    else:
        out.mkdir(parents=True, exist_ok=True)


def _learn_recorded(start: "Checkpoint", config: "TrainConfig", out: Path) -> "Checkpoint":
    """`start` with what the recorded pairs of the data say, where they are enough. Under
    `torchrun` the process that writes learns from them, and the others wait for it."""
    from spark.training.recorded_stage import recorded_stage, with_recorded
    from spark_sim import console
    from spark_sim.watching import is_first

    stage = recorded_stage(config) if is_first() else None
    if stage is None:
        return start
    console.note(stage.about)
    if stage.known is None:
        return start
    start, told = with_recorded(start, stage.known, config, out)
    console.note(told)
    return start


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
