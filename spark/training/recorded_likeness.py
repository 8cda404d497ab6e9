"""What recorded pairs say of the bodies in them, as `spark.network.likeness` tells it of others.

How far bodies are alike, how much of a pair is noise, and whether a habit is to be told at all: for
each, characters are left out, one at a time, and what surely helps them is taken (`surest`).
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int

from spark.network.likeness import Likeness, apart, covariance
from spark.network.recorded import HABITS
from spark.training.recorded_pairs import RecordedPairs

_LENGTHS = (1.0, 3.0)  # of likeness: two people are about 1 apart
_NOISES = (0.01, 0.03, 0.1, 0.3, 1.0, 3.0)  # of pairs, over what bodies differ by
_UNTOLD = 1.0  # the size of a habit that nothing is known of: no body has more
_LEAST = 1e-6  # variance
_CHOICES = [(length, noise) for length in _LENGTHS for noise in _NOISES]


def surest(gains: Float[np.ndarray, "C K"]) -> int | None:
    """Which of K things surely helps characters left out, by what each of C gained from each: the
    one whose mean gain, less its standard error, is most; None where that is not above 0."""
    if len(gains) < 2:
        return None
    least = gains.mean(0) - gains.std(0, ddof=1) / np.sqrt(len(gains))
    best = int(least.argmax())
    return best if least[best] > 0 else None


def fit_likeness(known: RecordedPairs) -> Likeness:
    """What these pairs say; of a habit that would not surely help characters left out, nothing."""
    return _Told(known).likeness()


@dataclass(frozen=True, eq=False)
class _Told:
    """Pairs, and what is best told of them."""

    known: RecordedPairs

    def characters(self) -> Iterator[tuple[str, Bool[np.ndarray, "P"]]]:
        """Each character that pairs have, and which of these have it."""
        names = np.array(self.known.characters)[self._ends]
        for name in np.unique(names):
            yield str(name), (names == name).any(1)

    def likeness(self) -> Likeness:
        """What the pairs say, as it is best told."""
        count = len(self._bodies)
        weights, lengths = np.zeros((count, len(HABITS))), np.ones(len(HABITS))
        sizes, certain = np.full(len(HABITS), _UNTOLD), np.zeros((len(HABITS), count, count))
        for h, best in enumerate(self._choices):
            if best is not None:
                choice, sizes[h] = best
                lengths[h], _ = choice
                matrix, right = self._normal(h, np.zeros(len(self.known.pairs), bool))
                weights[:, h] = self._solved(matrix, right, *choice)
                certain[h] = self._solved(matrix, matrix, *choice)
        return Likeness(self._measures, weights, lengths, sizes, certain)

    @cached_property
    def _choices(self) -> list[tuple[tuple[float, float], float] | None]:
        """Of `_CHOICES` the best for each habit, and the habit's standard deviation."""
        found: list[tuple[tuple[float, float], float] | None] = []
        for habit in range(len(HABITS)):
            tests = [*self._tests(habit)]
            best = surest(np.reshape([gains for gains, _ in tests], (len(tests), len(_CHOICES))))
            variance = 0.0 if best is None else np.mean([spread[best] for _, spread in tests])
            found.append(None if best is None else (_CHOICES[best], float(np.sqrt(variance))))
        return found

    @cached_property
    def _ends(self) -> Int[np.ndarray, "P 2"]:
        return np.array([(pair.source, pair.target) for pair in self.known.pairs])

    def _onto(self, character: str) -> Bool[np.ndarray, "P"]:
        """The pairs whose target it is."""
        found: Bool[np.ndarray, P] = np.array(self.known.characters)[self._ends[:, 1]] == character
        return found

    @cached_property
    def _bodies(self) -> Int[np.ndarray, "N"]:
        """Those that pairs have, as `known` numbers them."""
        return np.unique(self._ends)

    @cached_property
    def _measures(self) -> Float[np.ndarray, "N M"]:
        return np.stack([self.known.bodies[k].measures for k in self._bodies])

    @cached_property
    def _alike(self) -> dict[float, Float[np.ndarray, "N N"]]:
        distance = apart(self._measures, self._measures)
        return {length: covariance(distance, length) for length in _LENGTHS}

    @cached_property
    def _said(self) -> tuple[Float[np.ndarray, "P 6"], Float[np.ndarray, "P 6"]]:
        """Differences of habits, and their weights."""
        pairs = self.known.pairs
        weights = np.stack([pair.weights for pair in pairs]) * self.known.balance[:, None]
        return np.stack([pair.scales for pair in pairs]), weights

    def _tests(self, habit: int) -> Iterator[tuple[Float[np.ndarray, "K"], Float[np.ndarray, "K"]]]:
        """Of each character left out, for each choice: by how much a habit's squared error falls,
        and what is left of it where its variance is 1 without pairs."""
        numbers = np.searchsorted(self._bodies, self._ends)
        said, weights = (of_all[:, habit] for of_all in self._said)
        for name, out in self.characters():
            tested = self._onto(name)
            if not weights[tested].any():
                continue
            a, b = numbers[tested].T
            (matrix, right), gains, spreads = self._normal(habit, out), [], []
            for length, noise in _CHOICES:
                alike = self._alike[length]
                found = alike @ self._solved(matrix, right, length, noise)
                left = said[tested] - (found[b] - found[a])
                gains.append((weights[tested] * (said[tested] ** 2 - left**2)).sum())
                spread = alike - alike @ self._solved(matrix, matrix, length, noise) @ alike
                variance = spread[a, a] + spread[b, b] - 2 * spread[a, b]
                share = weights[tested] / weights[tested].sum()
                spreads.append((share * left**2 / np.maximum(variance, _LEAST)).sum())
            yield np.array(gains), np.array(spreads)

    def _normal(
        self, habit: int, left_out: Bool[np.ndarray, "P"]
    ) -> tuple[Float[np.ndarray, "N N"], Float[np.ndarray, "N"]]:
        """The normal equations of the known bodies' habits, by the pairs that are not left out."""
        said, weights = (np.where(left_out, 0.0, of_all[:, habit]) for of_all in self._said)
        share = weights / max(weights.sum(), 1e-12)
        a, b = np.searchsorted(self._bodies, self._ends).T
        matrix, right = np.zeros((len(self._bodies),) * 2), np.zeros(len(self._bodies))
        for i, j, sign in ((a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)):
            np.add.at(matrix, (i, j), sign * share)
        np.add.at(right, b, share * said)
        np.add.at(right, a, -share * said)
        return matrix, right

    def _solved(
        self,
        matrix: Float[np.ndarray, "N N"],
        right: Float[np.ndarray, "N *k"],
        length: float,
        noise: float,
    ) -> Float[np.ndarray, "N *k"]:
        """`Likeness.weights` of one habit; of the matrix itself, `Likeness.certain`."""
        prior = noise * np.eye(len(right))
        solved: Float[np.ndarray, N * k] = np.linalg.solve(
            matrix @ self._alike[length] + prior, right
        )
        return solved
