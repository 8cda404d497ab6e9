"""Several processes on one run, as `torchrun` starts them."""

import os
from datetime import timedelta

import torch
import torch.distributed as dist
from torch import nn
from torch.nn.parallel import DistributedDataParallel

from spark.errors import ConventionError

# Others wait so long for the first process, which alone learns from recorded pairs.
_PATIENCE = timedelta(hours=6)


def process_count() -> int:
    """How many processes torchrun started."""
    return int(os.environ.get("WORLD_SIZE", "1"))


def join_processes() -> tuple[int, int, torch.device]:
    """This process's rank, how many there are, and its device; joins what torchrun started."""
    world = process_count()
    cuda = torch.cuda.is_available()
    local = int(os.environ.get("LOCAL_RANK", "0"))
    if cuda:
        torch.cuda.set_device(local)  # else every process also holds memory on the first GPU
    if world > 1 and not dist.is_initialized():
        dist.init_process_group("nccl" if cuda else "gloo", timeout=_PATIENCE)
    rank = dist.get_rank() if world > 1 else 0
    return rank, world, torch.device("cuda", local) if cuda else torch.device("cpu")


def distributed(objective: nn.Module, *, unused: bool) -> nn.Module:
    """`objective` in each of several processes, their gradients averaged; `unused` where it leaves
    some of its parameters aside, as the published network does."""
    return DistributedDataParallel(objective, find_unused_parameters=unused)


def check_shares(draws: int, world: int) -> None:
    """Raise `ConventionError` where `world` processes can't have equal shares of a step's draws:
    the mean of their gradients would be another one."""
    if draws % world:
        fit = [n for n in range(1, draws + 1) if draws % n == 0]
        raise ConventionError(
            f"{world} processes for {draws} draws a step (batch / per_body): expected one of "
            f"{', '.join(map(str, fit))} processes, or another batch"
        )


def agreed(wish: bool) -> bool:
    """Whether any of the processes has this wish; all must ask at the same time."""
    if not dist.is_initialized():
        return wish
    device = "cuda" if dist.get_backend() == "nccl" else "cpu"
    flag = torch.tensor(float(wish), device=device)
    dist.all_reduce(flag, dist.ReduceOp.MAX)
    return bool(flag)
