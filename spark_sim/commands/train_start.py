"""Where a training run starts: anew, from what recorded pairs say, or where it stopped."""

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from spark.errors import ConventionError, OutputError
from spark_sim import console
from spark_sim.files import one_run
from spark_sim.watching import is_first, watching_stage

if TYPE_CHECKING:
    from spark.training.checkpoint import Checkpoint
    from spark.training.settings import TrainConfig

# What the weights in a checkpoint were made for.
_OF_THE_NETWORK = ("preset", "ablate", "width", "heads", "blocks", "names", "t5")


def hold(out: Path, held: ExitStack) -> None:
    """Make the folder of the run, and keep other runs out of it. Under `torchrun` the process that
    writes does. Raises `OutputError` where another run is in it."""
    if is_first():
        held.enter_context(one_run(out))
    else:
        out.mkdir(parents=True, exist_ok=True)


def resumed(out: Path, config: "TrainConfig") -> "Checkpoint":
    """What the run in `out` has come to. Raises `OutputError` where it can't go on as it was,
    `ConventionError` where it is asked for another network or for fewer steps."""
    from spark.training.checkpoint import load_checkpoint

    path = out / "checkpoint.safetensors"
    start = load_checkpoint(path)
    if start.step and not start.optimizer:
        raise OutputError(
            f"{path}: optimizer-{start.step}.safetensors is not beside it, and without it a run "
            "can't go on as it was; put it back, or start anew with --force"
        )
    _check_same_network(path, start.settings, config)
    if start.step > config.steps:
        raise ConventionError(
            f"--steps {config.steps}: the run in {out} is at step {start.step} already"
        )
    return start


def fresh(config: "TrainConfig") -> "Checkpoint":
    """An untrained network, and the encoder of names, which is trained first where no other is
    given."""
    from spark.training.train import fresh_checkpoint

    name_steps = 0 if config.names or config.t5 else config.name_steps
    with watching_stage("learning names", name_steps) as watch_names:
        return fresh_checkpoint(config, watch_names)


def learn_recorded(start: "Checkpoint", config: "TrainConfig", out: Path) -> "Checkpoint":
    """`start` with what the recorded pairs of the data say, where they are enough. Under
    `torchrun` the process that writes learns from them, and the others wait for it."""
    from spark.training.recorded_stage import recorded_stage, with_recorded

    stage = recorded_stage(config) if is_first() else None
    if stage is None:
        return start
    console.note(stage.about)
    if stage.known is None:
        return start
    start, told = with_recorded(start, stage.known, config, out)
    console.note(told)
    return start


def _check_same_network(path: Path, trained: Mapping[str, object], config: "TrainConfig") -> None:
    """Raise `ConventionError` where a resumed run is asked for another network than it has."""
    for name in _OF_THE_NETWORK:
        before, now = trained.get(name), getattr(config, name)
        before = tuple(before) if isinstance(before, list) else before
        if name in trained and before != now:
            raise ConventionError(
                f"{path}: was trained with {name} = {before!r}, not {now!r}; --resume goes on with "
                "the network that is there"
            )
