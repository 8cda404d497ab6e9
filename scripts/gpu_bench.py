"""What a step costs on the device at hand, and whether its numbers are those of a CPU, as Markdown.

Usage: python scripts/gpu_bench.py DATASET [BATCH...]
(a dataset of `spark-sim prepare`; windows in a step, 16 and 64 where none are named)

Each row trains for 60 steps, as `spark-sim train` would: `first` is the time until the first step
is done, compiling included, and the rest is of the last 40. `waits` is the share of it in which the
device waited for batches, `memory` the most that was taken. `apart` is how far joints of a
network's first answer are from a CPU's, at most, in hip heights: with the products that training
has, and all in float32. On a GPU the last size is measured compiled, too.
"""

import sys
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import torch
from jaxtyping import Float
from torch import Tensor, nn

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
from spark.training.steps import Steps, batches_from, name_vectors
from spark.training.tensors import forward_kinematics
from spark.training.train import fresh_checkpoint, take_step

STEPS, WARM = 60, 20


def main(dataset: str, *batches: str) -> None:
    device = join_processes()[2]
    clips, _ = training_clips([Path(dataset)])
    gpu = device.type == "cuda"
    name = torch.cuda.get_device_name() if gpu else f"the CPU, {torch.get_num_threads()} threads"
    print(f"{name}, torch {torch.__version__}\n")
    print("| preset | windows | compiled | first | step | windows/s | waits | memory | apart |")
    print("|---|---|---|---|---|---|---|---|---|")
    sizes = [int(batch) for batch in batches or (16, 64)]
    for compiles in (False, True) if gpu else (False,):
        for preset in ("paper", "default"):
            for batch in sizes[-1:] if compiles else sizes:
                config = replace(TrainConfig.of(preset), batch=batch, steps=STEPS)
                _row(clips, config, device, compiles)


def _row(
    clips: list[TrainingClip], config: TrainConfig, device: torch.device, compiles: bool
) -> None:
    start = fresh_checkpoint(config)
    names = name_vectors(start.names)
    steps = Steps(clips, names, config, 0, 1, fixed_sizes=True)
    apart = _apart(start.model, steps, device)
    objective = Objective(start.model.to(device), config).to(device)
    optimiser = make_optimiser(start.model, config)
    runner: nn.Module = compiled(objective) if compiles else objective
    start.model.train()
    if device.type == "cuda":
        torch.cuda.reset_peak_memory_stats()
    batches = batches_from(steps, 0, device)
    clock, waited, first = perf_counter(), 0.0, 0.0
    for n in range(STEPS):
        asked = perf_counter()
        batch = next(batches)
        waited += perf_counter() - asked
        float(take_step(runner, optimiser, batch, n, config)["loss"])
        if n == 0:
            first = perf_counter() - clock
        if n + 1 == WARM:
            clock, waited = perf_counter(), 0.0
    took = perf_counter() - clock
    step = took / (STEPS - WARM)
    memory = torch.cuda.max_memory_allocated() / 2**30 if device.type == "cuda" else 0.0
    told = f"{config.preset} | {config.batch} | {'yes' if compiles else 'no'} | {first:.1f} s"
    rates = f"{1000 * step:.1f} ms | {config.batch / step:.0f} | {waited / took:.0%}"
    print(f"| {told} | {rates} | {memory:.1f} GiB | {apart} |", flush=True)


def _apart(model: Spark, steps: Steps, device: torch.device) -> str:
    """How far joints of one batch are from a CPU's, at most, in hip heights."""
    model = deepcopy(model).eval()
    packed = Packer()([steps.draws(0)])
    with torch.no_grad():
        for zeros in (p for p in model.parameters() if not p.any()):
            zeros.normal_(std=0.1)  # where a network begins with no correction at all
        exact = _joints(model, packed.on(torch.device("cpu"))[0].batch())
        model, batch = model.to(device), packed.on(device)[0].batch()
        plain = _joints(model, batch)
        with fast_products(device):
            fast = _joints(model, batch)
    return " ".join(f"{float((p.cpu() - exact).norm(dim=-1).max()):.1g}" for p in (fast, plain))


def _joints(model: Spark, batch: Batch | UnpairedBatch) -> Float[Tensor, "B T J 3"]:
    """Where the network puts joints, its noise left out."""
    latent = model.encode(batch.pose, batch.source)
    noise = latent.new_zeros(*latent.shape[:2], batch.target.valid.shape[1], latent.shape[-1])
    start = batch.start if isinstance(batch, Batch) else None
    return forward_kinematics(model.decode(latent, batch.target, start, noise), batch.target)


if __name__ == "__main__":
    main(*sys.argv[1:])
