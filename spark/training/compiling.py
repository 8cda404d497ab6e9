"""One compiled graph for all steps of a run, where that pays."""

from typing import cast

import torch
from torch import nn

from spark.training.objective import Objective
from spark.training.settings import TrainConfig

_PAYS_FROM = 30 * 60.0  # [s]: compiling takes minutes
_STEP = 0.05  # [s], of a step on a GPU that is not compiled: at least (docs/training.md)


def compiles(config: TrainConfig, device: torch.device) -> bool:
    """Whether a run compiles its network."""
    if config.compile != "auto":
        return config.compile == "on"
    return device.type == "cuda" and config.steps * _STEP >= _PAYS_FROM


def compiled(objective: Objective, backend: str = "inductor") -> nn.Module:
    """`objective` as one graph. Its batches must be of one size (`spark.training.sizes`)."""
    graph = torch.compile(objective, fullgraph=True, dynamic=False, backend=backend)
    return cast(nn.Module, graph)
