"""Training windows a second: pairs made, put into batches and handed over, as Markdown.

Usage: python scripts/pairs_bench.py PRESET DATA...
(default, paper or tiny; datasets of `spark-sim prepare`, or folders of files)

Batches are those of the preset (of default: 4 draws of 4 windows of 64 frames), with 16 variants of
a body. The first steps, in which variants are made and names read, are counted apart, and those in
which workers begin are not counted. Beside the rate on the clock, which other work on the machine
lowers, stands that for a CPU second of a worker.
"""

import sys
import time
from dataclasses import replace
from pathlib import Path

import torch
from torch.utils.data import DataLoader

from spark.training.batch import PairDraws, UnpairedDraws
from spark.training.dataset import training_clips
from spark.training.name_encoder import NameEncoder
from spark.training.packed import AHEAD, Packed, Packer
from spark.training.settings import TrainConfig
from spark.training.steps import Steps, Travelling

FIRST, BEGUN, STEPS = 800, 400, 700
Travels = PairDraws | UnpairedDraws


class Timed(Travelling):
    """Steps with the CPU time of their process when they were done."""

    def __getitem__(self, n: int) -> tuple[Travels, float]:  # type: ignore[override]
        return super().__getitem__(n), time.process_time()


class TimedPacker(Packer):
    """Steps as the training hands them over."""

    def __call__(self, item: tuple[Travels, float]) -> tuple[Packed, float]:  # type: ignore[override]
        return super().__call__(item[0]), item[1]


def main(preset: str, *data: str) -> None:
    torch.set_num_threads(1)
    clips, _ = training_clips([Path(folder) for folder in data])
    config = replace(TrainConfig.of(preset), variants=16)
    names = NameEncoder().eval().remembering()
    steps = Timed(Steps(clips, names, config, 0, 1))
    began, clock = time.perf_counter(), time.process_time()
    for n in range(FIRST):
        done = steps[n][1]
    print("| | windows/s | windows for a CPU second of a worker |\n|---|---|---|")
    rate, of_cpu = FIRST / (time.perf_counter() - began), FIRST / (done - clock)
    print(f"| the first {FIRST} steps | {_windows(rate, config)} | {_windows(of_cpu, config)} |")
    padded = Timed(Steps(clips, names, config, 0, 1, fixed_sizes=True))
    for n in range(FIRST + STEPS - BEGUN):
        if n == FIRST:
            began, clock = time.perf_counter(), time.process_time()
        done = padded[n][1]
    rate = (STEPS - BEGUN) / (time.perf_counter() - began)
    of_cpu = (STEPS - BEGUN) / (done - clock)
    print(f"| padded to one size | {_windows(rate, config)} | {_windows(of_cpu, config)} |")
    for workers in (1, 2):
        numbers = range(FIRST, FIRST + STEPS)
        loader = DataLoader(
            steps,
            batch_size=None,
            sampler=numbers,
            num_workers=workers,
            prefetch_factor=AHEAD,
            collate_fn=TimedPacker(),
        )
        clocks = []
        for n, (_, clock) in enumerate(loader):
            clocks.append(clock)
            if n + 1 == BEGUN:
                began = time.perf_counter()
        rate = (STEPS - BEGUN) / (time.perf_counter() - began)
        each = [clocks[BEGUN + k :: workers] for k in range(workers)]
        used = sum(of_one[-1] - of_one[0] for of_one in each)
        of_cpu = (STEPS - BEGUN - workers) / used
        told = f"{workers} worker{'s' * (workers > 1)}"
        print(f"| {told} | {_windows(rate, config)} | {_windows(of_cpu, config)} |")


def _windows(steps: float, config: TrainConfig) -> int:
    return round(steps * config.batch)


if __name__ == "__main__":
    main(*sys.argv[1:])
