"""Training windows a second: pairs made, put into batches and handed over, as Markdown.

Usage: python scripts/pairs_bench.py PRESET DATA...
(default, paper or tiny; datasets of `spark-sim prepare`, or folders of files)

Batches are those of the preset (of default: 4 draws of 4 windows of 64 frames). In the first
steps, counted apart, variants of bodies are made and names read, as many as the preset has; the
other rows are of 16 variants a body, all made. Padded batches are what a GPU gets, with the way
from a worker to the trainer in the last two rows, where the steps in which workers begin are not
counted. Beside the rate on the clock stand those for a CPU second of a worker: of the median block
of steps, and of the best tenth, as other work on the machine takes caches and half of a core, too.
"""

import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from jaxtyping import Float
from torch.utils.data import DataLoader

from spark.training.batch import PairDraws, UnpairedDraws
from spark.training.dataset import training_clips
from spark.training.name_encoder import NameEncoder
from spark.training.packed import AHEAD, Packed, Packer
from spark.training.settings import TrainConfig
from spark.training.steps import Blocks, Steps

FIRST, BEGUN, STEPS = 800, 400, 700
Travels = tuple[PairDraws | UnpairedDraws, ...]


class Timed(Blocks):
    """Blocks of steps with the CPU time of their process when they were done."""

    def __getitem__(self, block: int) -> tuple[Travels, float]:  # type: ignore[override]
        return super().__getitem__(block), time.process_time()


class TimedPacker:
    """Blocks as the training hands them over."""

    def __init__(self) -> None:
        self.pack = Packer()

    def __call__(self, item: Any) -> tuple[Packed, float]:
        return self.pack(item[0]), item[1]


def main(preset: str, *data: str) -> None:
    torch.set_num_threads(1)
    clips, _ = training_clips([Path(folder) for folder in data])
    own = TrainConfig.of(preset)
    config = replace(own, variants=16)
    print("| | windows/s | for a CPU second of a worker | in the best tenth |\n|---|---|---|---|")
    for told, settings, fixed, warm, count in (
        (f"the first {FIRST} steps", own, True, 0, FIRST),
        ("one by one", config, False, FIRST, STEPS - BEGUN),
        ("padded to one size", config, True, FIRST, STEPS - BEGUN),
    ):
        names = NameEncoder().eval().remembering()
        blocks = Timed(Steps(clips, names, settings, 0, 1, fixed_sizes=fixed))
        size = blocks.steps.block
        clocks: list[float] = []
        for n in range((warm + count) // size):
            if n == warm // size:
                began, clocks = time.perf_counter(), [time.process_time()]
            clocks.append(blocks[n][1])
        rate = count / (time.perf_counter() - began)
        _row(told, config, rate, size / np.diff(clocks))
    for workers in (1, 2):
        loader = DataLoader(
            blocks,
            batch_size=None,
            sampler=range(FIRST // size, (FIRST + STEPS) // size),
            num_workers=workers,
            prefetch_factor=AHEAD,
            collate_fn=TimedPacker(),
        )
        clocks, begun = [], BEGUN // size
        for n, (_, clock) in enumerate(loader):
            clocks.append(clock)
            if n + 1 == begun:
                began = time.perf_counter()
        made = (len(clocks) - begun) * size
        rate = made / (time.perf_counter() - began)
        used = np.concatenate([np.diff(clocks[begun + k :: workers]) for k in range(workers)])
        told = f"padded, {workers} worker{'s' * (workers > 1)}"
        _row(told, config, rate, size / used)


def _row(told: str, config: TrainConfig, rate: float, of_cpu: Float[np.ndarray, "B"]) -> None:
    """Of steps a second on the clock, and in each block of CPU time."""
    steps = (rate, float(np.median(of_cpu)), float(np.percentile(of_cpu, 90)))
    print("|", " | ".join([told, *(f"{n * config.batch:.0f}" for n in steps)]), "|", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
