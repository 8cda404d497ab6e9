"""Training: the paper's unpaired objective, and the default preset's on pairs with exact answers.

Step n of a seed is always the same step, whatever ran before: its windows are draws by number, its
rate and its random numbers are functions of n. So a run that stops and resumes is, on a CPU, the
run that never stopped, to the bit. Under `torchrun` every process takes its share of each step's
draws; losses are means over windows, so the processes' mean gradient is that of one process.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import torch
from torch import nn

from spark.inference.weights import SHIPPED
from spark.network.known_bodies import distinct_trunks
from spark.training.batch import Batch, UnpairedBatch
from spark.training.checkpoint import Checkpoint, restore_optimizer
from spark.training.compiling import compiled, compiles
from spark.training.cuts import TrainingClip
from spark.training.keeper import Keeper, Watch
from spark.training.model import Spark
from spark.training.name_encoder import NameEncoder
from spark.training.name_file import load_names
from spark.training.objective import Objective, Terms, network
from spark.training.optimiser import make_optimiser, rate_at
from spark.training.precision import fast_products
from spark.training.processes import agreed, check_shares, distributed, join_processes
from spark.training.run_log import open_log
from spark.training.settings import TrainConfig
from spark.training.steps import Steps, batches_from, name_vectors
from spark.training.train_names import train_names


def fresh_checkpoint(
    config: TrainConfig, watch: Callable[[int, float], None] = lambda step, loss: None
) -> Checkpoint:
    """Where a run begins: the names that ship (or those read, learned, or a T5's), the network as
    its seed makes it.

    Every process makes the same one. `watch` is told step and loss while names are learned.
    """
    names: NameEncoder | str = config.t5 or _own_names(config, watch)
    width = name_vectors(names)(["Hips"]).shape[-1]
    torch.manual_seed(config.seed)
    return Checkpoint(Spark(network(config, width)), names)


def _own_names(config: TrainConfig, watch: Callable[[int, float], None]) -> NameEncoder:
    if config.name_steps and not config.names:
        return train_names(config.name_steps, seed=config.seed, watch=watch)
    return load_names(SHIPPED if config.names in ("", "shipped") else Path(config.names))


def train(
    clips: Sequence[TrainingClip],
    config: TrainConfig,
    out: Path,
    *,
    start: Checkpoint,
    watch: Watch = lambda step, terms: None,
    stop: Callable[[], bool] = lambda: False,
) -> Checkpoint:
    """Train from `start` to `config.steps`; `out/checkpoint.safetensors` and `out/log.jsonl` grow.

    Raises `DivergedError` where a loss is no finite number; the last good checkpoint stays.
    `watch` is told each step that is done, with its loss terms where they are logged. Where `stop`
    is true after a step, that step is saved, and is the last. On a GPU the network computes in
    bf16, and is compiled where that pays. Under `torchrun` the first process writes;
    `ConventionError` where there are more processes than a step has draws, or they can't share them
    evenly.
    """
    rank, world, device = join_processes()
    check_shares(config.draws, world)
    model = start.model.to(device)
    objective = Objective(model, config).to(device)
    optimiser = make_optimiser(model, config)
    restore_optimizer(optimiser, model, start.optimizer)
    one_graph = compiles(config, device)
    runner: nn.Module = compiled(objective) if one_graph else objective
    if world > 1:
        runner = distributed(runner, unused=not model.config.residual)
    own = start.names == config.t5  # else it is the checkpoint's word alone
    names = name_vectors(start.names, own=own)
    steps = Steps(clips, names, config, rank, world, fixed_sizes=one_graph or device.type == "cuda")
    bodies = distinct_trunks(clip.body for clip in clips)
    model.train()
    done = start.step
    with open_log(out, start.step, rank) as log:
        keeper = Keeper(start, optimiser, config, out, bodies, log, watch)
        for n, batch in zip(
            range(start.step, config.steps),
            batches_from(steps, start.step, device),
            strict=True,
        ):
            terms = take_step(runner, optimiser, batch, n, config, rank)
            done = n + 1
            logs = done in (1, config.steps) or done % config.log_every == 0
            # Processes agree on it, which takes a moment, where they wait for one another anyway.
            stopped = agreed(stop()) if world == 1 or logs else False
            if not rank:
                last = stopped or done == config.steps
                keeper.keep(done, terms, logs=logs, last=last)
            if stopped:
                break
    return replace(keeper.checkpoint, step=done)


def take_step(
    runner: nn.Module,
    optimiser: torch.optim.Optimizer,
    batch: Batch | UnpairedBatch,
    n: int,
    config: TrainConfig,
    rank: int = 0,
) -> Terms:
    """Step number `n`: one batch, one update; the loss terms, and the `loss` that they make."""
    torch.manual_seed(hash((config.seed, n, rank)))
    for group in optimiser.param_groups:
        group["lr"] = rate_at(n, config)
    with fast_products(batch.pose.root.device, config.bf16):
        loss, terms = runner(batch)
    optimiser.zero_grad()
    loss.backward()
    optimiser.step()
    return {"loss": loss.detach(), **{k: v.detach() for k, v in terms.items()}}
