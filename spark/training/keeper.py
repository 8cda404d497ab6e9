"""What a run leaves in its folder as it goes: a log of its losses, and the last good checkpoint."""

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from time import perf_counter
from typing import TextIO

import torch
from torch import Tensor

from spark.errors import DivergedError
from spark.inference.weights import Trunk
from spark.training.checkpoint import Checkpoint, optimizer_tensors, save_checkpoint
from spark.training.settings import TrainConfig

Watch = Callable[[int, dict[str, float]], None]
"""Is told each step that is done, and its losses where they are logged."""


class Keeper:
    """Keeps what steps come to, from `start` on, in the folder `out`.

    `bodies` are those that are trained on; `checkpoint` is the last that was saved.
    """

    def __init__(
        self,
        start: Checkpoint,
        optimiser: torch.optim.Optimizer,
        config: TrainConfig,
        out: Path,
        bodies: Sequence[Trunk],
        log: TextIO,
        watch: Watch,
    ) -> None:
        self.checkpoint = start
        self._path = out / "checkpoint.safetensors"
        self._optimiser, self._config, self._bodies = optimiser, config, list(bodies)
        self._log, self._watch = log, watch
        self._began = self._saved = perf_counter()

    def keep(self, done: int, terms: Mapping[str, Tensor], *, logs: bool, last: bool) -> None:
        """Tell of step `done`, log it where `logs`, and save it where it is the `last` or a save
        is due. Raises `DivergedError` where its losses or weights are no finite numbers."""
        saves = last or done % self._config.save_every == 0
        saves = saves or perf_counter() - self._saved > 60 * self._config.save_minutes
        values = {k: float(v) for k, v in terms.items()} if logs or saves else {}
        self._check_finite(done, values.items())
        if logs:
            seconds = round(perf_counter() - self._began, 3)
            self._log.write(json.dumps({"step": done, "seconds": seconds, **values}) + "\n")
            self._log.flush()
        self._watch(done, values if logs else {})
        if saves:
            self._save(done)

    def _save(self, done: int) -> None:
        model = self.checkpoint.model
        self._check_finite(
            done, ((name, float(p.detach().sum())) for name, p in model.named_parameters())
        )
        self.checkpoint = replace(
            self.checkpoint,
            step=done,
            settings=asdict(self._config),
            bodies=self._bodies,
            optimizer=optimizer_tensors(self._optimiser, model),
        )
        save_checkpoint(self.checkpoint, self._path)
        self._saved = perf_counter()

    def _check_finite(self, done: int, numbers: Iterable[tuple[str, float]]) -> None:
        """Raise `DivergedError` where a loss term, or the sum of a parameter, is no number."""
        bad = next((name for name, value in numbers if not math.isfinite(value)), None)
        if bad is None:
            return
        saved = self.checkpoint.step
        kept = f"the checkpoint of step {saved} is kept" if saved else "no checkpoint was written"
        raise DivergedError(
            f"training diverged at step {done}: {bad} is no finite number; {kept}. A lower rate, "
            "or a longer warmup, helps"
        )
