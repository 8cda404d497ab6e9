"""Training: the paper's unpaired objective, and the default preset's on pairs with exact answers.

Step n of a seed is always the same step, whatever ran before: its windows are draws by number, its
rate and its random numbers are functions of n. So a run that stops and resumes is, on a CPU, the
run that never stopped, to the bit. Under `torchrun` every process takes its share of each step's
draws; losses are means over windows, so the processes' mean gradient is that of one process.
"""

import json
import math
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from time import perf_counter
from typing import TextIO

import torch
import torch.distributed as dist
from jaxtyping import Float
from torch import Tensor, nn
from torch.nn.parallel import DistributedDataParallel
from torch.utils.data import DataLoader, Dataset

from spark.errors import DivergedError
from spark.files import write_atomically
from spark.network.config import Config
from spark.network.known_bodies import distinct_trunks
from spark.network.t5 import NAME_CACHE, T5Names
from spark.training import losses
from spark.training.batch import Batch, Collator, Names
from spark.training.checkpoint import (
    Checkpoint,
    optimizer_tensors,
    restore_optimizer,
    save_checkpoint,
)
from spark.training.model import Spark
from spark.training.name_encoder import NameEncoder
from spark.training.name_file import load_names
from spark.training.packed import AHEAD, Packed, Packer
from spark.training.pairs import PairMaker, TrainingClip
from spark.training.precision import fast_products
from spark.training.settings import TrainConfig
from spark.training.tensors import forward_kinematics
from spark.training.train_names import train_names

BETAS = (0.9, 0.99)  # of AdamW, as the paper has them

Terms = dict[str, Float[Tensor, ""]]


def network(config: TrainConfig, name_width: int) -> Config:
    """The network of a training run: the preset's, with the ablations' switches thrown."""
    preset = Config.paper() if config.preset == "paper" else Config.default()
    return replace(
        preset,
        width=config.width,
        heads=config.heads,
        encoder_blocks=config.blocks,
        decoder_blocks=config.blocks,
        name_width=name_width + 2,
        share_joints="share" not in config.ablate,
        mask_joints=0.0 if "mask" in config.ablate else preset.mask_joints,
        positions_in=preset.positions_in ^ ("pos" in config.ablate),
    )


def fresh_checkpoint(config: TrainConfig) -> Checkpoint:
    """Where a run begins: names learned (or read, or a T5's), the network as its seed makes it.

    Every process makes the same one.
    """
    names: NameEncoder | str = config.t5 or _own_names(config)
    width = name_vectors(names)(["Hips"]).shape[-1]
    torch.manual_seed(config.seed)
    return Checkpoint(Spark(network(config, width)), names)


def _own_names(config: TrainConfig) -> NameEncoder:
    if config.names:
        return load_names(Path(config.names))
    return train_names(config.name_steps, seed=config.seed)


class Objective(nn.Module):
    """A network with its loss: what one step makes smaller."""

    def __init__(self, model: Spark, config: TrainConfig) -> None:
        super().__init__()
        self.model = model
        weights = losses.PAIR_LOSS_WEIGHTS if model.config.residual else losses.PAPER_LOSS_WEIGHTS
        self.weights = {k: w for k, w in weights.items() if k != "fk" or "fk" not in config.ablate}

    def forward(self, batch: Batch) -> tuple[Float[Tensor, ""], Terms]:
        """The weighted sum of the terms, and each of them without its weight."""
        terms = self._paired(batch) if self.model.config.residual else self._unpaired(batch)
        return torch.stack([w * terms[k] for k, w in self.weights.items()]).sum(), terms

    def _unpaired(self, batch: Batch) -> Terms:
        """Section 4.5: A reconstructs A; what A becomes on B is encoded as A was."""
        latent = self.model.encode(batch.pose, batch.source)
        same = self.model.decode(latent, batch.source)
        moved = self.model.decode(latent, batch.target)
        return {
            "rec": losses.reconstruction(same, batch.pose, batch.source),
            "cyc": losses.cycle(latent, self.model.encode(moved, batch.target)),
            "root": losses.root(same, batch.pose),
            "fk": losses.positions(
                forward_kinematics(same, batch.source),
                forward_kinematics(batch.pose, batch.source),
                batch.source,
            ),
        }

    def _paired(self, batch: Batch) -> Terms:
        """Against the exact answer on B, with the feet and the ends of limbs on top."""
        moved = self.model(batch.pose, batch.source, batch.target, batch.start)
        positions = forward_kinematics(moved, batch.target)
        truth = forward_kinematics(batch.truth, batch.target)
        return {
            "rec": losses.reconstruction(moved, batch.truth, batch.target),
            "root": losses.root(moved, batch.truth),
            "fk": losses.positions(positions, truth, batch.target),
            "contact": losses.contact(positions, batch.planted, batch.frame_time, batch.target),
            "ends": losses.end_effectors(positions, truth, batch.effectors),
        }


class Steps(Dataset[Batch]):
    """Item n: this process's share of step n's windows."""

    def __init__(
        self,
        clips: Sequence[TrainingClip],
        names: Names,
        config: TrainConfig,
        rank: int,
        world: int,
    ) -> None:
        self.config, self.rank, self.world = config, rank, world
        self.maker = PairMaker(
            clips,
            window=config.window,
            variants=config.variants,
            seed=config.seed,
            distinct=config.preset == "paper" and "mix" not in config.ablate,
            varied=config.preset != "paper",
        )
        self.collator = Collator(names)

    def __getitem__(self, n: int) -> Batch:
        first = n * self.config.draws
        mine = range(first + self.rank, first + self.config.draws, self.world)
        return self.collator.batch(self.maker.draws(mine, self.config.per_body))


def make_optimiser(model: nn.Module, config: TrainConfig) -> torch.optim.AdamW:
    """AdamW; weight decay on matrices alone, not on norms, biases, queries and places."""
    matrices = [p for m in model.modules() if isinstance(m, nn.Linear) for p in [m.weight]]
    decayed = {id(p) for p in matrices}
    others = [p for p in model.parameters() if id(p) not in decayed]
    return torch.optim.AdamW(
        [
            {"params": matrices, "weight_decay": config.weight_decay},
            {"params": others, "weight_decay": 0.0},
        ],
        lr=config.rate,
        betas=BETAS,
        fused=True,
    )


def rate_at(step: int, config: TrainConfig) -> float:
    """The learning rate of a step: up in a line, then down a cosine to a tenth."""
    if step < config.warmup:
        return config.rate * (step + 1) / config.warmup
    done = (step - config.warmup) / max(config.steps - config.warmup, 1)
    return config.rate * (0.55 + 0.45 * math.cos(math.pi * min(done, 1.0)))


Watch = Callable[[int, dict[str, float]], None]


def train(
    clips: Sequence[TrainingClip],
    config: TrainConfig,
    out: Path,
    *,
    start: Checkpoint,
    watch: Watch = lambda step, terms: None,
) -> Checkpoint:
    """Train from `start` to `config.steps`; `out/checkpoint.safetensors` and `out/log.jsonl` grow.

    Raises `DivergedError` where a loss is no finite number; the last good checkpoint stays.
    `watch` is told the loss terms after each step that is logged. On a GPU the network is compiled
    and computes in bf16. Under `torchrun` the first process writes.
    """
    rank, world, device = _join_processes()
    model = start.model.to(device)
    objective = Objective(model, config).to(device)
    optimiser = make_optimiser(model, config)
    restore_optimizer(optimiser, model, start.optimizer)
    runner = distributed(objective) if world > 1 else objective
    if device.type == "cuda":
        runner = torch.compile(runner, dynamic=True)  # type: ignore[assignment]
    own = start.names == config.t5  # else it is the checkpoint's word alone
    steps = Steps(clips, name_vectors(start.names, own=own), config, rank, world)
    bodies = distinct_trunks(clip.body for clip in clips)
    checkpoint = start
    model.train()
    began = perf_counter()
    with _log(out, start.step, rank) as log:
        for n, batch in zip(
            range(start.step, config.steps), _batches(steps, start.step), strict=True
        ):
            terms = take_step(runner, optimiser, batch.on(device), n, config, rank)
            if rank:
                continue
            done = n + 1
            logs, saves = (
                done % every == 0 or done == config.steps
                for every in (config.log_every, config.save_every)
            )
            if logs or saves:
                values = {k: float(v) for k, v in terms.items()}
                _check_finite(done, values.items(), checkpoint.step)
            if logs:
                entry = {"step": done, "seconds": round(perf_counter() - began, 3), **values}
                log.write(json.dumps(entry) + "\n")
                log.flush()
                watch(done, values)
            if saves:
                parameters = ((k, float(p.detach().sum())) for k, p in model.named_parameters())
                _check_finite(done, parameters, checkpoint.step)
                state = optimizer_tensors(optimiser, model)
                checkpoint = Checkpoint(model, start.names, done, asdict(config), bodies, state)
                save_checkpoint(checkpoint, out / "checkpoint.safetensors")
    return checkpoint


def _check_finite(done: int, numbers: Iterable[tuple[str, float]], saved: int) -> None:
    """Raise `DivergedError` where a loss term, or the sum of a parameter, is no number."""
    bad = next((name for name, value in numbers if not math.isfinite(value)), None)
    if bad is None:
        return
    kept = f"the checkpoint of step {saved} is kept" if saved else "no checkpoint was written"
    raise DivergedError(
        f"training diverged at step {done}: {bad} is no finite number; {kept}. A lower rate, or a "
        "longer warmup, helps"
    )


def distributed(objective: Objective) -> nn.Module:
    """`objective` in each of several processes, their gradients averaged."""
    # The published network leaves some of the parameters that there are unused.
    unused = not objective.model.config.residual
    return DistributedDataParallel(objective, find_unused_parameters=unused)


def take_step(
    runner: nn.Module,
    optimiser: torch.optim.Optimizer,
    batch: Batch,
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


def _join_processes() -> tuple[int, int, torch.device]:
    """This process's rank, how many there are, and its device; joins what torchrun started."""
    world = int(os.environ.get("WORLD_SIZE", "1"))
    cuda = torch.cuda.is_available()
    local = int(os.environ.get("LOCAL_RANK", "0"))
    if cuda:
        torch.cuda.set_device(local)  # else every process also holds memory on the first GPU
    if world > 1 and not dist.is_initialized():
        dist.init_process_group("nccl" if cuda else "gloo")
    rank = dist.get_rank() if world > 1 else 0
    return rank, world, torch.device("cuda", local) if cuda else torch.device("cpu")


def name_vectors(names: NameEncoder | str, *, own: bool = True) -> Names:
    """What turns joint names into vectors: our own encoder, or the T5 of that name, which the user
    gave or (not `own`) a checkpoint did."""
    if isinstance(names, NameEncoder):
        return names.cpu().remembering()
    return T5Names(names, NAME_CACHE, own=own).encode


def _batches(steps: Steps, start: int) -> Iterator[Packed]:
    config = steps.config
    return iter(
        DataLoader(
            steps,
            batch_size=None,
            sampler=range(start, config.steps),
            num_workers=config.workers,
            prefetch_factor=AHEAD if config.workers else None,
            collate_fn=Packer(),  # type: ignore[arg-type]  # of an item: there is no batch_size
            pin_memory=torch.cuda.is_available(),
        )
    )


def _log(out: Path, step: int, rank: int) -> TextIO:
    """The log, cut back to what had happened by `step`; nothing on other processes than the first.

    A run that died between two checkpoints has logged steps that are now taken again.
    """
    if rank:
        return open(os.devnull, "w")
    out.mkdir(parents=True, exist_ok=True)
    path = out / "log.jsonl"
    lines = path.read_text(errors="replace").splitlines() if path.exists() else []
    kept = [line for line in lines if _logged_step(line) <= step] if step else []
    write_atomically(path, "".join(f"{line}\n" for line in kept).encode())
    return path.open("a")


def _logged_step(line: str) -> float:
    """Which step a line of the log tells of; none that was taken where it is half written."""
    try:
        return float(json.loads(line)["step"])
    except (ValueError, KeyError, TypeError):
        return math.inf
