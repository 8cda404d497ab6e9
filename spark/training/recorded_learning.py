"""Learning from recorded pairs.

What the habits of two bodies differ by (`spark.training.recorded_net`) is held against what
recorded pairs say, in the position error that it makes. Characters left out of the training, a
quarter at a time, say how much of it to trust, and how far from the known bodies a body may be.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from spark.network.recorded import KnownBodies
from spark.network.recorded_network import VERSION
from spark.training.recorded_answers import answers_of, error
from spark.training.recorded_net import RecordedNet, bodies_of
from spark.training.recorded_pairs import RecordedPairs
from spark.training.recorded_ridge import fit_ridge
from spark.training.recorded_trust import Trust, tested

_RATE, _WARMUP = 1e-3, 30  # learning rate, steps
_DECAY = 0.1  # weight decay
_FOLDS = 4
_MIN_LEFT_OUT = 4  # characters; fewer are no test


@dataclass(frozen=True, eq=False)
class Recorded:
    """A trained network, how far it may be trusted, and the bodies that it met."""

    net: RecordedNet
    trust: Trust
    known: KnownBodies

    def tensors(self) -> dict[str, Tensor]:
        """What a checkpoint keeps: `spark.network.recorded_network` reads it."""
        about = {
            "version": torch.tensor(VERSION),
            "heads": torch.tensor(float(self.net.heads)),
            "blocks": torch.tensor(float(len(self.net.layers))),
            "trust": torch.tensor(self.trust.shares, dtype=torch.float32),
            "known": torch.tensor(self.known.traits, dtype=torch.float32),
            "reach": torch.tensor(self.known.reach, dtype=torch.float32),
        }
        return {k: v.detach() for k, v in self.net.state_dict().items()} | about


Watch = Callable[[int, float], None]


def learn_recorded(
    known: RecordedPairs,
    *,
    width: int,
    heads: int,
    blocks: int,
    steps: int,
    seed: int = 0,
    watch: Watch = lambda step, loss: None,
) -> Recorded:
    """Train on these pairs, `steps` steps with each quarter of the characters left out and as many
    with all; `watch` is told of each step."""
    bodies = bodies_of(known.bodies)
    characters = sorted({known.characters[pair.target] for pair in known.pairs})
    order = np.random.default_rng(seed).permutation(len(characters))
    folds = [{characters[i] for i in order[k::_FOLDS]} for k in range(_FOLDS)]
    done = 0

    def train(pairs: RecordedPairs) -> RecordedNet:
        nonlocal done
        torch.manual_seed(seed)
        net = RecordedNet(fit_ridge(pairs), bodies.features.shape[-1], width, heads, blocks)
        optimiser = torch.optim.AdamW(net.parameters(), lr=_RATE, weight_decay=_DECAY)
        answers = answers_of(pairs)
        for step in range(steps):
            for group in optimiser.param_groups:
                up, left = min(1.0, (step + 1) / _WARMUP), 1 - step / steps
                group["lr"] = _RATE * up * left
            loss = error(net(bodies.blurred()), answers)
            optimiser.zero_grad()
            torch.autograd.backward(loss)
            optimiser.step()
            done += 1
            watch(done, loss.item())
        return net.eval().requires_grad_(False)

    tests = []
    for fold in folds:
        others, left_out = known.without(fold), known.of(fold)
        if len(characters) >= 2 * _MIN_LEFT_OUT and others.enough and left_out.pairs:
            tests.append((others, left_out, train(others)))
    net = train(known)
    trust = tested(tests, bodies)
    met = sorted({end for pair in known.pairs for end in (pair.source, pair.target)})
    traits = np.stack([known.bodies[k].traits for k in met])
    return Recorded(net, trust, KnownBodies(traits, trust.reach))


def total_steps(steps: int) -> int:
    """How many steps `learn_recorded` takes in all."""
    return steps * (_FOLDS + 1)
