"""What a step costs on the device at hand, and whether its answers are those of a CPU, as Markdown.

Usage: python scripts/gpu_bench.py DATASET [BATCH...]
(a dataset of `spark-sim prepare`; windows in a step, 16 and 64 where none are named)

First comes how far joints of a network's first answer are from those on a CPU, at most, in hip
heights. Then each row trains for 60 steps on four batches that lie on the device: `first` is the
time of the first step, compiling included, `step` the mean of the last 40, `memory` the most that
was taken. On a GPU the last size is measured compiled, too.
"""

import sys
from copy import deepcopy
from dataclasses import replace
from itertools import cycle, islice
from pathlib import Path
from time import perf_counter

import torch
from jaxtyping import Float
from torch import Tensor

from spark.training.batch import Batch, UnpairedBatch
from spark.training.compiling import compiled
from spark.training.cuts import TrainingClip
from spark.training.dataset import training_clips
from spark.training.model import Spark
from spark.training.objective import Objective
from spark.training.optimiser import make_optimiser
from spark.training.packed import Packer
from spark.training.precision import fast_products
from spark.training.processes import join_processes
from spark.training.settings import TrainConfig
from spark.training.steps import Steps, name_vectors
from spark.training.tensors import forward_kinematics
from spark.training.train import fresh_checkpoint, take_step

STEPS, WARM, BATCHES = 60, 20, 4
PRESETS = ("paper", "default")


def main(dataset: str, *batches: str) -> None:
    device = join_processes()[2]
    clips, _ = training_clips([Path(dataset)])
    gpu = device.type == "cuda"
    name = torch.cuda.get_device_name() if gpu else f"the CPU, {torch.get_num_threads()} threads"
    print(f"{name}, torch {torch.__version__}\n")
    for preset in PRESETS:
        apart, exact = _apart(clips, TrainConfig.of(preset), device)
        print(f"{preset}: joints are {apart:.1g} apart, {exact:.1g} without bfloat16\n", flush=True)
    print("| preset | windows | compiled | first | step | windows/s | memory |")
    print("|---|---|---|---|---|---|---|", flush=True)
    sizes = [int(batch) for batch in batches or (16, 64)]
    for compiles in (False, True) if gpu else (False,):
        for preset in PRESETS:
            for batch in sizes[-1:] if compiles else sizes:
                config = replace(TrainConfig.of(preset), batch=batch, steps=STEPS)
                _row(clips, config, device, compiles)


def _row(
    clips: list[TrainingClip], config: TrainConfig, device: torch.device, compiles: bool
) -> None:
    model, steps = _begun(clips, config)
    batches = [_on(device, steps, n) for n in range(BATCHES)]
    objective = Objective(model.train().to(device), config).to(device)
    optimiser = make_optimiser(model, config)
    runner = compiled(objective) if compiles else objective
    if device.type == "cuda":
        torch.cuda.reset_peak_memory_stats()
    first, clock = 0.0, perf_counter()
    for n, batch in enumerate(islice(cycle(batches), STEPS)):
        terms = take_step(runner, optimiser, batch, n, config)
        if n in (0, WARM - 1):
            float(terms["loss"])  # waits for the device
            first, clock = first or perf_counter() - clock, perf_counter()
    float(terms["loss"])
    step = (perf_counter() - clock) / (STEPS - WARM)
    memory = torch.cuda.max_memory_allocated() / 2**30 if device.type == "cuda" else 0.0
    told = f"{config.preset} | {config.batch} | {'yes' if compiles else 'no'} | {first:.1f} s"
    rates = f"{1000 * step:.1f} ms | {config.batch / step:.0f} | {memory:.1f} GiB"
    print(f"| {told} | {rates} |", flush=True)


def _apart(
    clips: list[TrainingClip], config: TrainConfig, device: torch.device
) -> tuple[float, float]:
    """How far joints of one batch are from a CPU's, with products as in training, and exact."""
    model, steps = _begun(clips, config)
    model.eval()
    with torch.no_grad():
        for zeros in (p for p in model.parameters() if not p.any()):
            zeros.normal_(std=0.1)  # where a network begins with no correction at all
        expected = _joints(deepcopy(model), _on(torch.device("cpu"), steps, 0))
        model, batch = model.to(device), _on(device, steps, 0)
        exact = _joints(model, batch)
        with fast_products(device):
            fast = _joints(model, batch)
    far = (float((p.cpu() - expected).norm(dim=-1).max()) for p in (fast, exact))
    return next(far), next(far)


def _begun(clips: list[TrainingClip], config: TrainConfig) -> tuple[Spark, Steps]:
    start = fresh_checkpoint(config)
    return start.model, Steps(clips, name_vectors(start.names), config, 0, 1, fixed_sizes=True)


def _on(device: torch.device, steps: Steps, n: int) -> Batch | UnpairedBatch:
    """Step n's batch."""
    draws: Batch | UnpairedBatch = Packer()([steps.draws(n)]).on(device)[0].batch()
    return draws


def _joints(model: Spark, batch: Batch | UnpairedBatch) -> Float[Tensor, "B T J 3"]:
    """Where the network puts joints, its noise left out."""
    latent = model.encode(batch.pose, batch.source)
    noise = latent.new_zeros(*latent.shape[:2], batch.target.valid.shape[1], latent.shape[-1])
    start = batch.start if isinstance(batch, Batch) else None
    return forward_kinematics(model.decode(latent, batch.target, start, noise), batch.target)


if __name__ == "__main__":
    main(*sys.argv[1:])
