"""AdamW and its learning rate."""

import math

import torch
from torch import nn

from spark.training.settings import TrainConfig

BETAS = (0.9, 0.99)  # of AdamW, as the paper has them


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
