"""How far what was learned from recorded pairs is to be trusted, told by characters left out."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float

from spark.network.recorded import KnownBodies
from spark.training.recorded_answers import answers_of
from spark.training.recorded_net import Bodies, RecordedNet
from spark.training.recorded_pairs import RecordedPairs

_MOST = 0.8  # of what is gained within the best distance


@dataclass(frozen=True, eq=False)
class Trust:
    """`shares` of what the network says beside the linear model, of turns and of scales; the
    `reach` (`KnownBodies`), and the share of the squared error that is `left`."""

    shares: Float[np.ndarray, "2"]
    reach: float
    left: float


def tested(tests: list[tuple[RecordedPairs, RecordedPairs, RecordedNet]], bodies: Bodies) -> Trust:
    """From pairs that a network was trained on, pairs of characters left out, and that network."""
    if not tests:
        return Trust(np.zeros(2), 0.0, 1.0)
    products = [_products(pairs, net, bodies) for _, pairs, net in tests]
    total = sum(
        np.einsum("p,pxyz->xyz", pairs.balance, of_pairs)
        for (_, pairs, _), of_pairs in zip(tests, products, strict=True)
    )
    # What the network does best with is its regression on what the linear model leaves.
    agreement = total[:, 2, 1] - total[:, 0, 1]
    shares = np.clip(agreement / np.maximum(total[:, 1, 1], 1e-12), 0.0, 1.0)
    mix = np.stack([np.ones(2), shares, -np.ones(2)], axis=1)
    gains: dict[tuple[float, str], float] = {}
    before = after = 0.0
    for (others, pairs, _), of_pairs in zip(tests, products, strict=True):
        met = {end for pair in others.pairs for end in (pair.source, pair.target)}
        near = KnownBodies(np.stack([pairs.bodies[k].traits for k in sorted(met)]), 1.0)
        zero = of_pairs[:, :, 2, 2].sum(1) * pairs.balance
        left = np.einsum("xy,pxyz,xz->p", mix, of_pairs, mix) * pairs.balance
        for pair, gain in zip(pairs.pairs, (zero - left).tolist(), strict=True):
            key = near.distance(pairs.bodies[pair.target]), pairs.characters[pair.target]
            gains[key] = gains.get(key, 0.0) + gain
        before, after = before + float(zero.sum()), after + float(left.sum())
    distances, values = zip(*((d, gain) for (d, _), gain in sorted(gains.items())), strict=True)
    gained = np.cumsum(values)
    # As far as what is gained on the whole stays near its most: single characters say little.
    reached = np.flatnonzero(gained >= _MOST * gained.max())[-1]
    reach = float(distances[reached]) if gained.max() > 0 else 0.0
    return Trust(shares, reach, after / before if before else 1.0)


def _products(
    pairs: RecordedPairs, net: RecordedNet, bodies: Bodies
) -> Float[np.ndarray, "P 2 3 3"]:
    """Of each pair, of turns and of scales, weighted products of what linear model, network and
    answer say."""
    answers = answers_of(pairs)
    with torch.no_grad():
        linear, own = map(answers.given, net(bodies))
    turns, scales = (
        torch.stack(three, -1).double().numpy()
        for three in zip(linear, own, (answers.turns, answers.scales), strict=True)
    )
    balance = pairs.balance / pairs.balance.sum()
    out = np.zeros((len(balance), 2, 3, 3))
    weights = answers.scale_weights.double().numpy() / balance[:, None]
    out[:, 1] = np.einsum("ph,phy,phz->pyz", weights, scales, scales)
    rows = np.repeat(np.arange(len(balance)), [len(pair.rows) for pair in pairs.pairs])
    weights = answers.turn_weights.double().numpy() / balance[rows]
    np.add.at(out[:, 0], rows, np.einsum("r,rcy,rcz->ryz", weights, turns, turns))
    return out
