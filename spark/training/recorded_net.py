"""The objective on recorded pairs: a network that foretells a body's habits from its T-pose.

A small transformer looks at the joints of a body (places, bones, turn of the rest pose) and gives
each joint a turn and the body its scales (`spark.network.recorded.Habits`), beside a linear part,
and zero at the start. What the habits of two bodies differ by is held against what recorded pairs
say (`spark.training.recorded_pairs`), in the position error that it makes.

Characters left out of the training, a quarter at a time, say how much of each output to trust, and
how far from the known bodies a body may be.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor, nn

from spark.network.recorded import HABITS, PARTS, BodyTokens, Habits, KnownBodies
from spark.network.recorded_network import HABIT_SCALE
from spark.training.attention import Attention, Feedforward
from spark.training.recorded_pairs import RecordedPairs

_RATE, _WARMUP = 1e-3, 30  # learning rate, steps
_DECAY = 0.1  # weight decay
_NOISE = 0.03  # of tokens; 10 times as much of measures: two people are about 1 apart in these
_TURN_SIZE, _SCALE_SIZE = 0.1, 0.05  # [rad], and of a scale: errors beyond count less than squared
_SMALLEST_LEVER = 0.01  # [hip heights] of joints that no other joint hangs from
_FOLDS = 4
_MOST = 0.8  # of what is gained within the best distance
_MIN_LEFT_OUT = 4  # characters; fewer are no test


class RecordedNet(nn.Module):
    """Tokens of joints to turns and scales."""

    def __init__(self, features: int, measures: int, width: int, heads: int, blocks: int) -> None:
        super().__init__()
        self.heads = heads
        self.tokens, self.body = nn.Linear(features, width), nn.Linear(measures, width)
        self.layers = nn.ModuleList(_Block(width, heads) for _ in range(blocks))
        self.norm = nn.LayerNorm(width)
        self.turns, self.scales = nn.Linear(width, 3), nn.Linear(width, len(HABITS))
        self.linear_turns = nn.Parameter(torch.zeros(len(PARTS), 3, 3))
        self.linear = nn.Parameter(torch.zeros(len(HABITS), measures))
        for head in (self.turns, self.scales):
            nn.init.zeros_(head.weight)
            nn.init.zeros_(head.bias)

    def forward(self, bodies: "Bodies") -> tuple[Float[Tensor, "N K 3"], Float[Tensor, "N 6"]]:
        """Turns of the joints and scales of N bodies."""
        x = self.tokens(bodies.features) + self.body(bodies.measures)[:, None]
        for block in self.layers:
            x = block(x, bodies.held[:, None])
        x = self.norm(x)
        linear = torch.einsum("nkx,nkxy->nky", bodies.rest_turns, self.linear_turns[bodies.parts])
        held = bodies.held[..., None]
        mean = (x * held).sum(1) / held.sum(1)
        scales = self.scales(mean) + bodies.measures @ self.linear.T
        return HABIT_SCALE * self.turns(x) + linear, HABIT_SCALE * scales


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


class _Answers(NamedTuple):
    """What P pairs say: differences of scales with weights, and R turns of (pair, body, row)."""

    ends: Tensor
    scales: Float[Tensor, "P 6"]
    scale_weights: Float[Tensor, "P 6"]
    turned: Tensor  # R rows: source, its row, target, its row
    turns: Float[Tensor, "R 3"]
    turn_weights: Float[Tensor, "R"]


@dataclass(frozen=True, eq=False)
class Recorded:
    """A trained network, what it may be trusted with (turns, then each scale), the bodies that it
    met; `gain` is the share of the squared error that it left on characters left out."""

    net: RecordedNet
    trust: Float[np.ndarray, "7"]
    known: KnownBodies
    gain: float

    def tensors(self) -> dict[str, Tensor]:
        """What a checkpoint keeps: `spark.network.recorded_network` reads it."""
        about = {
            "heads": torch.tensor(float(self.net.heads)),
            "blocks": torch.tensor(float(len(self.net.layers))),
            "trust": torch.tensor(self.trust, dtype=torch.float32),
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
    bodies = _bodies(known.bodies)
    characters = sorted({known.characters[pair.target] for pair in known.pairs})
    order = np.random.default_rng(seed).permutation(len(characters))
    folds = [{characters[i] for i in order[k::_FOLDS]} for k in range(_FOLDS)]
    done = 0

    def train(pairs: RecordedPairs) -> RecordedNet:
        nonlocal done
        torch.manual_seed(seed)
        net = RecordedNet(
            bodies.features.shape[-1], bodies.measures.shape[-1], width, heads, blocks
        )
        optimiser = torch.optim.AdamW(net.parameters(), lr=_RATE, weight_decay=_DECAY)
        answers = _answers(pairs)
        for step in range(steps):
            for group in optimiser.param_groups:
                up, left = min(1.0, (step + 1) / _WARMUP), 1 - step / steps
                group["lr"] = _RATE * up * left
            loss = _loss(net(bodies.blurred()), answers)
            optimiser.zero_grad()
            torch.autograd.backward(loss)
            optimiser.step()
            done += 1
            watch(done, loss.item())
        return net.eval().requires_grad_(False)

    tests = []
    for fold in folds:
        others, tested = known.without(fold), known.of(fold)
        if len(characters) >= 2 * _MIN_LEFT_OUT and others.enough and tested.pairs:
            tests.append((others, tested, train(others)))
    net = train(known)
    trust, reach, gain = _tested(tests, bodies)
    met = sorted({end for pair in known.pairs for end in (pair.source, pair.target)})
    traits = np.stack([known.bodies[k].traits for k in met])
    return Recorded(net, trust, KnownBodies(traits, reach), gain)


def total_steps(steps: int) -> int:
    """How many steps `learn_recorded` takes in all."""
    return steps * (_FOLDS + 1)


def habits_of(net: RecordedNet, bodies: list[BodyTokens]) -> list[Habits]:
    """What the network says of bodies, whatever it may be trusted with."""
    with torch.no_grad():
        turns, scales = net(_bodies(bodies))
    return [
        Habits(turns[k, : len(body.joints)].double().numpy(), scales[k].double().numpy())
        for k, body in enumerate(bodies)
    ]


def _loss(
    found: tuple[Float[Tensor, "N K 3"], Float[Tensor, "N 6"]], answers: _Answers
) -> Float[Tensor, ""]:
    turns, scales = found
    source, target = answers.ends.unbind(-1)
    errors = scales[target] - scales[source] - answers.scales
    of_scales = (_robust(errors.square(), _SCALE_SIZE) * answers.scale_weights).sum()
    a, i, b, k = answers.turned.unbind(-1)
    turn_errors = (turns[b, k] - turns[a, i] - answers.turns).square().sum(-1)
    of_turns = (_robust(turn_errors, _TURN_SIZE) * answers.turn_weights).sum()
    return of_scales + of_turns


def _robust(squared: Tensor, size: float) -> Tensor:
    """The square of small errors, and less of those above `size`: some files are spoilt."""
    return 2 * size**2 * (torch.sqrt(1 + squared / size**2) - 1)


def _bodies(tokens: list[BodyTokens]) -> Bodies:
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


def _answers(known: RecordedPairs) -> _Answers:
    balance = known.balance / known.balance.sum()
    levers = [_levers(body) for body in known.bodies]
    turned, turns, weights = [], [], []
    for pair, weight in zip(known.pairs, balance, strict=True):
        for (k, i), turn in zip(pair.rows, pair.turns, strict=True):
            turned.append((pair.source, i, pair.target, k))
            turns.append(turn)
            weights.append(weight * levers[pair.target][k])
    scale_weights = np.stack([pair.weights for pair in known.pairs]) * balance[:, None]
    return _Answers(
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


def _tested(
    tests: list[tuple[RecordedPairs, RecordedPairs, RecordedNet]], bodies: Bodies
) -> tuple[Float[np.ndarray, "7"], float, float]:
    """How much of each output to trust, the reach, and the share of the error that is left."""
    if not tests:
        return np.zeros(7), 0.0, 1.0
    agreement, size = np.zeros(7), np.zeros(7)
    told: list[tuple[RecordedPairs, RecordedPairs, np.ndarray]] = []
    for others, tested, net in tests:
        with torch.no_grad():
            turns, scales = (x.double().numpy() for x in net(bodies))
        answers = _answers(tested)
        # Of each pair and output: predicted times true, predicted squared, true squared.
        sums = np.zeros((len(tested.pairs), 7, 3))
        source, target = answers.ends.numpy().T
        weights = answers.scale_weights.double().numpy() / tested.balance[:, None]
        sums[:, 1:] = _products(scales[target] - scales[source], answers.scales, weights)
        a, i, b, k = answers.turned.numpy().T
        rows = np.repeat(np.arange(len(tested.pairs)), [len(pair.rows) for pair in tested.pairs])
        weights = answers.turn_weights.double().numpy()[:, None] / tested.balance[rows, None]
        of_turns = _products(turns[b, k] - turns[a, i], answers.turns, weights).sum(1)
        np.add.at(sums[:, 0], rows, of_turns)
        weighted = (sums * tested.balance[:, None, None]).sum(0)
        agreement, size = agreement + weighted[:, 0], size + weighted[:, 1]
        told.append((others, tested, sums))
    trust = np.clip(agreement / np.maximum(size, 1e-12), 0.0, 1.0)
    gains: dict[tuple[float, str], float] = {}
    before = after = 0.0
    for others, tested, sums in told:
        met = {end for pair in others.pairs for end in (pair.source, pair.target)}
        near = KnownBodies(np.stack([tested.bodies[k].traits for k in sorted(met)]), 1.0)
        gained = (2 * trust * sums[..., 0] - trust**2 * sums[..., 1]).sum(1) * tested.balance
        for pair, value in zip(tested.pairs, gained.tolist(), strict=True):
            key = near.distance(tested.bodies[pair.target]), tested.characters[pair.target]
            gains[key] = gains.get(key, 0.0) + value
        before += float((sums[..., 2].sum(1) * tested.balance).sum())
        after -= float(gained.sum())
    distances, values = zip(*((d, v) for (d, _), v in sorted(gains.items())), strict=True)
    total = np.cumsum(values)
    # As far as what is gained on the whole stays near its most: single characters say little.
    reached = np.flatnonzero(total >= _MOST * total.max())[-1]
    reach = float(distances[reached]) if total.max() > 0 else 0.0
    return trust, reach, (before + after) / before if before else 1.0


def _products(
    predicted: np.ndarray, true: Tensor, weights: np.ndarray
) -> Float[np.ndarray, "*n 3"]:
    answer = true.double().numpy()
    found = np.stack([predicted * answer, predicted**2, answer**2], -1)
    return found * weights[..., None]
