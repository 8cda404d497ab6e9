"""How joints turn further with their rest pose, as recorded pairs have it: a matrix a body part.

Makers who let hands or feet rest otherwise turn them otherwise, by as much: three numbers to three.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from spark.network.recorded import PARTS
from spark.training.recorded_pairs import RecordedPairs

_NOISE = 1e-3  # [rad²] the mean square of a turn that is noise
_MIRROR = np.array([-1.0, 1.0, -1.0])  # of an axis to turn about


class _Rows(NamedTuple):
    """Joints of pairs: which pair's, of which part, how much further its rest pose is turned than
    the source's [rad], and how much further it turns itself; whether it has a side."""

    pair: Int[np.ndarray, "R"]
    part: Int[np.ndarray, "R"]
    resting: Float[np.ndarray, "R 3"]
    turn: Float[np.ndarray, "R 3"]
    sided: Bool[np.ndarray, "R"]


@dataclass(frozen=True, eq=False)
class PairTurns:
    """The turns that recorded pairs measure, each target counting alike."""

    known: RecordedPairs

    def fitted(self, left_out: Bool[np.ndarray, "P"] | None = None) -> Float[np.ndarray, "K 3 3"]:
        """What maps the turn of a rest pose to that of a joint of each of `PARTS`, by the pairs
        that are not left out; 0 for parts that none has."""
        rows = self._rows
        weights = self.known.balance[rows.pair]
        if left_out is not None:
            weights = np.where(left_out[rows.pair], 0.0, weights)
        out = np.zeros((len(PARTS), 3, 3))
        for part in range(len(PARTS)):
            here = (rows.part == part) & (weights > 0)
            if not here.any():
                continue
            # What lies in the middle of a body turns as likely to the other side.
            middle = here & ~rows.sided
            x, y = (np.concatenate([v[here], _MIRROR * v[middle]]) for v in rows[2:4])
            w = np.concatenate([weights[here], weights[middle]])
            noise = w.sum() * _NOISE * np.eye(3)
            out[part] = np.linalg.solve((x.T * w) @ x + noise, (x.T * w) @ y)
        return out

    def gain(self, left_out: Bool[np.ndarray, "P"], tested: Bool[np.ndarray, "P"]) -> float:
        """By how much the squared turns of `tested` pairs fall by what is fitted without those
        `left_out`."""
        rows, maps = self._rows, self.fitted(left_out)
        here = tested[rows.pair]
        x, y = rows.resting[here], rows.turn[here]
        left = y - np.einsum("rx,rxy->ry", x, maps[rows.part[here]])
        falls = (np.square(y) - np.square(left)).sum(-1)
        return float((self.known.balance[rows.pair[here]] * falls).sum())

    @cached_property
    def _rows(self) -> _Rows:
        pairs, parts, resting, turns, sided = [], [], [], [], []
        for number, pair in enumerate(self.known.pairs):
            source, target = (self.known.bodies[end] for end in (pair.source, pair.target))
            own, theirs = (list(of_one) for of_one in zip(*pair.rows, strict=True))
            pairs.append(np.full(len(own), number))
            parts.append(target.parts[own])
            resting.append(target.rest_turns[own] - source.rest_turns[theirs])
            turns.append(pair.turns)
            sided.append(target.sided[own])
        return _Rows(*(np.concatenate(column) for column in (pairs, parts, resting, turns, sided)))
