"""Several processes on one run, as `torchrun` starts them."""

import os

import torch
import torch.distributed as dist
from torch import nn
from torch.nn.parallel import DistributedDataParallel

from spark.training.objective import Objective


def join_processes() -> tuple[int, int, torch.device]:
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


def distributed(objective: Objective) -> nn.Module:
    """`objective` in each of several processes, their gradients averaged."""
    # The published network leaves some of the parameters that there are unused.
    unused = not objective.model.config.residual
    return DistributedDataParallel(objective, find_unused_parameters=unused)


def agreed(wish: bool) -> bool:
    """Whether any of the processes has this wish; all must ask at the same time."""
    if not dist.is_initialized():
        return wish
    device = "cuda" if dist.get_backend() == "nccl" else "cpu"
    flag = torch.tensor(float(wish), device=device)
    dist.all_reduce(flag, dist.ReduceOp.MAX)
    return bool(flag)
