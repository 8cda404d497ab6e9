"""The linear model of recorded pairs: habits as products with a body's measures.

The row to beat for what `spark.training.recorded_learning` learns; `spark-sim evaluate` prints it.
In closed form; how strongly it is regularised, or whether a scale is left alone, is chosen by
leaving characters out.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from spark.network.recorded import HABITS, BodyTokens
from spark.training.recorded_pairs import RecordedPairs

_STRENGTHS = (0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0, np.inf)  # the last leaves a scale alone
_FOLDS = 8


@dataclass(frozen=True, eq=False)
class Ridge:
    """`scales` maps measures to `HABITS`."""

    scales: Float[np.ndarray, "M 6"]

    def __call__(self, body: BodyTokens) -> Float[np.ndarray, "6"]:
        habits: Float[np.ndarray, 6] = body.measures @ self.scales
        return habits


def fit_ridge(known: RecordedPairs) -> Ridge:
    """The linear model of these pairs."""
    measures = np.stack([body.measures for body in known.bodies])
    ends = np.array([(pair.source, pair.target) for pair in known.pairs])
    X = measures[ends[:, 1]] - measures[ends[:, 0]]
    Y = np.stack([pair.scales for pair in known.pairs])
    W = np.stack([pair.weights for pair in known.pairs]) * known.balance[:, None]
    folds = _folds(ends)
    scales = [_of_scale(X, Y[:, h], W[:, h], ends, folds) for h in range(len(HABITS))]
    return Ridge(np.stack(scales, -1))


def _folds(ends: np.ndarray) -> list[np.ndarray]:
    """Characters in groups that are left out one after the other."""
    order = np.random.default_rng(0).permutation(np.unique(ends))
    return [order[k::_FOLDS] for k in range(_FOLDS)]


def _of_scale(
    X: Float[np.ndarray, "P M"],
    y: Float[np.ndarray, "P"],
    w: Float[np.ndarray, "P"],
    ends: np.ndarray,
    folds: list[np.ndarray],
) -> Float[np.ndarray, "M"]:
    errors = np.zeros(len(_STRENGTHS))
    for fold in folds:
        tested = np.isin(ends[:, 1], fold)
        others = ~np.isin(ends, fold).any(1)
        if not others.any():
            continue
        for k, strength in enumerate(_STRENGTHS):
            slopes = _solved(X[others], y[others], w[others], strength)
            errors[k] += (w[tested] * (y[tested] - X[tested] @ slopes) ** 2).sum()
    return _solved(X, y, w, _STRENGTHS[int(errors.argmin())])


def _solved(
    X: Float[np.ndarray, "P M"],
    y: Float[np.ndarray, "P"],
    w: Float[np.ndarray, "P"],
    strength: float,
) -> Float[np.ndarray, "M"]:
    if not np.isfinite(strength) or not w.any():
        return np.zeros(X.shape[1])
    share = w / w.sum()
    return np.linalg.solve(
        (X * share[:, None]).T @ X + strength * np.eye(X.shape[1]), (X * share[:, None]).T @ y
    )
