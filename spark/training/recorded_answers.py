"""What recorded pairs say, as tensors, and by how much a network misses it."""

from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Float, Int
from torch import Tensor

from spark.network.recorded import BodyTokens
from spark.training.recorded_net import Outputs
from spark.training.recorded_pairs import RecordedPairs

_TURN_SIZE, _SCALE_SIZE = 0.1, 0.05  # [rad], and of a scale: errors beyond count less than squared
_SMALLEST_LEVER = 0.01  # [hip heights] of joints that no other joint hangs from


class Answers(NamedTuple):
    """What P pairs say: differences of scales with weights, and R turns of (source, its row,
    target, its row)."""

    ends: Int[Tensor, "P 2"]
    scales: Float[Tensor, "P 6"]
    scale_weights: Float[Tensor, "P 6"]
    turned: Int[Tensor, "R 4"]
    turns: Float[Tensor, "R 3"]
    turn_weights: Float[Tensor, "R"]

    def given(self, said: Outputs) -> tuple[Float[Tensor, "R 3"], Float[Tensor, "P 6"]]:
        """What habits of bodies make of these pairs: turns and differences of scales."""
        turns, scales = said
        source, target = self.ends.unbind(-1)
        a, i, b, k = self.turned.unbind(-1)
        return turns[b, k] - turns[a, i], scales[target] - scales[source]


def answers_of(known: RecordedPairs) -> Answers:
    """What these pairs say; each target counts alike, each joint as what hangs from it."""
    balance = known.balance / known.balance.sum()
    levers = [_levers(body) for body in known.bodies]
    turned, turns, weights = [], [], []
    for pair, weight in zip(known.pairs, balance, strict=True):
        for (k, i), turn in zip(pair.rows, pair.turns, strict=True):
            turned.append((pair.source, i, pair.target, k))
            turns.append(turn)
            weights.append(weight * levers[pair.target][k])
    scale_weights = np.stack([pair.weights for pair in known.pairs]) * balance[:, None]
    return Answers(
        torch.tensor([(pair.source, pair.target) for pair in known.pairs]),
        torch.tensor(np.stack([pair.scales for pair in known.pairs])).float(),
        torch.tensor(scale_weights).float(),
        torch.tensor(turned),
        torch.tensor(np.stack(turns)).float(),
        torch.tensor(weights).float(),
    )


def _levers(body: BodyTokens) -> Float[np.ndarray, "K"]:
    """The mean squared error of joints [hip heights²] for each squared radian of a joint's turn:
    what hangs from it moves with its bones."""
    skeleton = body.body.skeleton
    row = {j: k for k, j in enumerate(body.body.joints.tolist())}
    out = []
    for joint in body.joints:
        below = skeleton.children[row[joint]]
        moved = (
            float(np.square(skeleton.offsets[c]).sum()) * len(skeleton.subtree(c)) for c in below
        )
        out.append(max(sum(moved) / len(skeleton), _SMALLEST_LEVER**2))
    return np.array(out)


def error(found: tuple[Outputs, Outputs], answers: Answers) -> Float[Tensor, ""]:
    """The position error that linear model and network make together, each pair's by its weight."""
    of_turns, of_scales = (sum(both) for both in zip(*map(answers.given, found), strict=True))
    turn_errors = (of_turns - answers.turns).square().sum(-1)
    scale_errors = (of_scales - answers.scales).square()
    return (_robust(turn_errors, _TURN_SIZE) * answers.turn_weights).sum() + (
        _robust(scale_errors, _SCALE_SIZE) * answers.scale_weights
    ).sum()


def _robust(squared: Tensor, size: float) -> Tensor:
    """The square of small errors, and less of those above `size`: some files are spoilt."""
    return 2 * size**2 * (torch.sqrt(1 + squared / size**2) - 1)
