"""The network for recorded pairs: it foretells a body's habits from its T-pose.

The linear model of `spark.training.recorded_ridge` says what it can. A small transformer looks at
the joints of a body (places, bones, turn of the rest pose) and gives each joint a turn and the body
its scales (`spark.network.recorded.Habits`) beside that, zero at the start.
"""

from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from spark.network.recorded import HABITS, BodyTokens, Habits
from spark.network.recorded_network import HABIT_SCALE
from spark.training.attention import Attention, Feedforward
from spark.training.recorded_ridge import Ridge

_NOISE = 0.03  # of tokens; 10 times as much of measures: two people are about 1 apart in these

Outputs = tuple[Float[Tensor, "N K 3"], Float[Tensor, "N 6"]]
"""Turns [rad] of the joints and scales of N bodies."""


class RecordedNet(nn.Module):
    """Tokens of joints to turns and scales."""

    linear_turns: Float[Tensor, "P 3 3"]
    linear: Float[Tensor, "M 6"]

    def __init__(self, ridge: Ridge, features: int, width: int, heads: int, blocks: int) -> None:
        super().__init__()
        self.heads = heads
        measures = len(ridge.scales)
        self.tokens, self.body = nn.Linear(features, width), nn.Linear(measures, width)
        self.layers = nn.ModuleList(_Block(width, heads) for _ in range(blocks))
        self.norm = nn.LayerNorm(width)
        self.turns, self.scales = nn.Linear(width, 3), nn.Linear(width, len(HABITS))
        self.register_buffer("linear_turns", torch.tensor(ridge.turns).float())
        self.register_buffer("linear", torch.tensor(ridge.scales).float())
        for head in (self.turns, self.scales):
            nn.init.zeros_(head.weight)
            nn.init.zeros_(head.bias)

    def forward(self, bodies: "Bodies") -> tuple[Outputs, Outputs]:
        """What the linear model says of N bodies, and the network beside it."""
        x = self.tokens(bodies.features) + self.body(bodies.measures)[:, None]
        for block in self.layers:
            x = block(x, bodies.held[:, None])
        x = self.norm(x)
        turns = torch.einsum("nkx,nkxy->nky", bodies.rest_turns, self.linear_turns[bodies.parts])
        held = bodies.held[..., None]
        mean = (x * held).sum(1) / held.sum(1)
        own = HABIT_SCALE * self.turns(x), HABIT_SCALE * self.scales(mean)
        return (turns, bodies.measures @ self.linear), own


class _Block(nn.Module):
    def __init__(self, width: int, heads: int) -> None:
        super().__init__()
        self.norm, self.norm_ff = nn.LayerNorm(width), nn.LayerNorm(width)
        self.attention = Attention(width, heads)
        self.ff = Feedforward(width, 4 * width, width)

    def forward(self, x: Float[Tensor, "N K D"], held: Bool[Tensor, "N 1 K"]) -> Tensor:
        """Joints of a body look at one another."""
        x = x + self.attention(self.norm(x), mask=held)
        return x + self.ff(self.norm_ff(x))


class Bodies(NamedTuple):
    """Tokens of N bodies, padded to K joints; `held` marks the joints that are there."""

    features: Float[Tensor, "N K F"]
    measures: Float[Tensor, "N M"]
    rest_turns: Float[Tensor, "N K 3"]
    parts: Tensor
    held: Bool[Tensor, "N K"]

    def blurred(self) -> "Bodies":
        """With noise, so that no body is known by heart."""
        return self._replace(
            features=self.features + _NOISE * torch.randn_like(self.features),
            measures=self.measures + 10 * _NOISE * torch.randn_like(self.measures),
        )


def bodies_of(tokens: list[BodyTokens]) -> Bodies:
    """The tokens of bodies as tensors."""
    size = max(len(body.joints) for body in tokens)

    def padded(arrays: list[np.ndarray]) -> Tensor:
        rows = [np.pad(x, [(0, size - len(x)), *[(0, 0)] * (x.ndim - 1)]) for x in arrays]
        return torch.tensor(np.stack(rows))

    return Bodies(
        padded([body.features for body in tokens]).float(),
        torch.tensor(np.stack([body.measures for body in tokens])).float(),
        padded([body.rest_turns for body in tokens]).float(),
        padded([body.parts for body in tokens]),
        padded([np.ones(len(body.joints), bool) for body in tokens]),
    )


def habits_of(
    net: RecordedNet, bodies: list[BodyTokens], trust: Float[np.ndarray, "2"]
) -> list[Habits]:
    """What the linear model says of bodies, and `trust` of what the network does."""
    with torch.no_grad():
        said = [
            [
                Habits(turns[k, : len(body.joints)].double().numpy(), scales[k].double().numpy())
                for k, body in enumerate(bodies)
            ]
            for turns, scales in net(bodies_of(bodies))
        ]
    return [linear.plus(own, trust) for linear, own in zip(*said, strict=True)]
