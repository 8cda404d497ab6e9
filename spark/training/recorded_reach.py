"""How far from known bodies what recorded pairs say still helps, told by characters left out."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from spark.network.likeness import Likeness
from spark.network.recorded import BodyTokens, KnownBodies, sure
from spark.training.recorded_likeness import surest
from spark.training.recorded_pairs import RecordedPair, RecordedPairs


class Test(NamedTuple):
    """Pairs, what they tell of bodies like theirs, and pairs of characters left out."""

    others: RecordedPairs
    told: Likeness
    left_out: RecordedPairs


class Reach(NamedTuple):
    """The `reach` of `KnownBodies`, and the share of the squared error that is `left` within it and
    without."""

    reach: float
    left: float


def tested(tests: list[Test]) -> Reach:
    """The distance up to which characters left out surely gain (`surest`); 0 where they don't."""
    if not tests:
        return Reach(0.0, 1.0)
    rows = [row for test in tests for row in _rows(test)]
    names, distances, before, left = (np.array(column) for column in zip(*rows, strict=True))
    tried = np.unique(distances)
    within = (before - left)[:, None] * (distances[:, None] <= tried)
    best = surest(np.array([within[names == name].sum(0) for name in np.unique(names)]))
    return Reach(0.0 if best is None else float(tried[best]), float(left.sum() / before.sum()))


def met(pairs: RecordedPairs) -> Float[np.ndarray, "N L"]:
    """The traits of the bodies that these pairs have."""
    ends = {end for pair in pairs.pairs for end in (pair.source, pair.target)}
    return np.stack([pairs.bodies[k].traits for k in sorted(ends)])


def _rows(test: Test) -> list[tuple[str, float, float, float]]:
    """Of each pair left out: its character, how far that is from known bodies, and its squared
    error without a correction and with it."""
    pairs, bodies = test.left_out, test.left_out.bodies
    known, rows = KnownBodies(met(test.others), 1.0), []
    for pair, weight in zip(pairs.pairs, pairs.balance.tolist(), strict=True):
        target = bodies[pair.target]
        before, left = _errors(pair, bodies[pair.source], target, test.told)
        name = pairs.characters[pair.target]
        rows.append((name, known.distance(target), weight * before, weight * left))
    return rows


def _errors(
    pair: RecordedPair, source: BodyTokens, target: BodyTokens, told: Likeness
) -> tuple[float, float]:
    """The squared error of positions [hip heights²] of a pair, without a correction and with it."""
    found = sure(told(target) - told(source), told.doubt(source, target))
    before, left = (
        float((pair.weights * np.square(scales)).sum())
        for scales in (pair.scales, pair.scales - found)
    )
    return before, left
