"""What a user sees of a training run: progress on stderr, a plot, TensorBoard's logs."""

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from spark_sim import console

if TYPE_CHECKING:
    from spark.training.keeper import Watch
    from spark.training.loss_plot import LossPlot


def is_first() -> bool:
    """Whether this process is the only one, or the one of `torchrun`'s that writes."""
    return os.environ.get("RANK", "0") == "0"


@contextmanager
def watching(out: Path, step: int, total: int, *, board: bool) -> "Iterator[Watch]":
    """What a run tells of its steps, from `step` on. Under `torchrun` one process tells."""
    if not is_first():
        yield lambda step, terms: None
        return
    plot = _plot(out)
    with (
        _board(out, step) if board else nullcontext(_no_board) as write,
        console.meter(total, step, "training", lines=True) as tell,
    ):

        def watch(step: int, terms: dict[str, float]) -> None:
            tell(step, terms)
            if terms:
                write(step, terms)
                if plot:
                    plot.update()

        try:
            yield watch
        finally:
            if plot:
                plot.update(now=True)


@contextmanager
def watching_stage(what: str, total: int) -> Iterator[Callable[[int, float], None]]:
    """What a stage before the training itself tells of its steps: their loss."""
    if not is_first():
        yield lambda step, loss: None
        return
    with console.meter(total, 0, what, lines=total > 0) as tell:
        yield lambda step, loss: tell(step, {"loss": loss})


def _plot(out: Path) -> "LossPlot | None":
    from spark.training.loss_plot import LossPlot

    try:
        return LossPlot(out)
    except ImportError as error:
        console.note(
            f"no plot of the losses: it needs {error.name}: pip install 'spark-sim[train]'"
        )
        return None


def _no_board(step: int, terms: Mapping[str, float]) -> None:
    pass


@contextmanager
def _board(out: Path, step: int) -> "Iterator[Callable[[int, Mapping[str, float]], None]]":
    """What writes loss terms for TensorBoard."""
    from torch.utils.tensorboard import SummaryWriter

    with SummaryWriter(str(out), purge_step=step + 1) as writer:

        def tell(step: int, terms: Mapping[str, float]) -> None:
            for name, value in terms.items():
                writer.add_scalar(name, value, step)

        yield tell
