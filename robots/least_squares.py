"""Least squares over whole trajectories: normal equations a frame, coupled by smoothness in time.

A problem's unknowns are a step in D columns for each of T frames. Its residuals see one frame each;
only the accelerations tie neighbours together. So the normal equations are banded, of width 2 D,
and a banded Cholesky solves them in time linear in T (Golub and Van Loan, section 4.3).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations_with_replacement, pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.linalg import solveh_banded

_IMMOVABLE = 1e8
REACH = 2  # an acceleration ties a frame to the two next
_BEND = (1.0, -2.0, 1.0)


class Normal:
    """Normal equations `H step = -g` being added up; `cost` is half the sum of squares."""

    def __init__(self, frames: int, columns: int, rows: bool = True) -> None:
        self.rows = rows
        self.H = np.zeros((frames, columns, columns) if rows else (0, 0, 0))
        self.g = np.zeros((frames, columns) if rows else (0, 0))
        self.cost = np.zeros(frames)

    def add(
        self,
        columns: Sequence[int],
        J: Float[np.ndarray, "T C M"],
        residuals: Float[np.ndarray, "M T"],
    ) -> None:
        """M weighted residuals a frame, and how fast they grow with some columns."""
        self.cost += 0.5 * np.einsum("mt,mt->t", residuals, residuals)
        if not self.rows or not len(columns):
            return
        H = J @ J.transpose(0, 2, 1)
        g = (J @ residuals.T[:, :, None])[:, :, 0]
        runs = _runs(columns)
        for here, there in runs:
            self.g[:, there] += g[:, here]
            for here2, there2 in runs:
                self.H[:, there, there2] += H[:, here, here2]

    def add_some(
        self,
        frames: Int[np.ndarray, "S"],
        columns: Sequence[int],
        J: Float[np.ndarray, "C S"],
        residuals: Float[np.ndarray, "S"],
    ) -> None:
        """One weighted residual in some of the frames."""
        self.cost[frames] += 0.5 * residuals**2
        at = np.asarray(columns)
        self.g[frames[:, None], at] += (J * residuals).T
        self.H[frames[:, None, None], at[:, None], at] += np.einsum("cs,ds->scd", J, J)

    def add_diagonal(
        self, rows: Float[np.ndarray, "T D"], residuals: Float[np.ndarray, "T D"]
    ) -> None:
        """One residual for each column, that grows with no other."""
        self.cost += 0.5 * (residuals**2).sum(1)
        if self.rows:
            at = np.arange(self.g.shape[1])
            self.H[:, at, at] += rows**2
            self.g += rows * residuals

    def mixed(self, other: "Normal", share: Float[np.ndarray, "T"]) -> "Normal":
        """So much of other ones, a frame, and the rest of these."""
        out = Normal(0, 0)
        out.H = self.H + share[:, None, None] * (other.H - self.H)
        out.g = self.g + share[:, None] * (other.g - self.g)
        out.cost = self.cost + share * (other.cost - self.cost)
        return out

    def pin(self, pinned: Bool[np.ndarray, "T D"]) -> None:
        """Keep some columns from moving."""
        free = np.where(pinned, 0.0, 1.0)
        self.H *= free[:, :, None] * free[:, None]
        at = np.arange(free.shape[1])
        self.H[:, at, at] += 1.0 - free
        self.g *= free

    def solve_apart(self, damping: float) -> Float[np.ndarray, "T D"]:
        """The step, each frame for itself."""
        D = self.g.shape[1]
        return -np.linalg.solve(self.H + damping * np.eye(D), self.g[..., None])[..., 0]

    def solve_together(
        self,
        ties: "Ties",
        damping: Float[np.ndarray, "T"],
        limits: Float[np.ndarray, "T D"],
    ) -> Float[np.ndarray, "T D"]:
        """The step that also lessens what ties neighbours together. Columns with `limits` of 1 (-1)
        are at their upper (lower) one, and don't move where that would take them beyond."""
        T, D = self.g.shape
        band = np.zeros((REACH * D + 1, T, D))
        for i in range(D):
            for k in range(D - i):
                band[k, :, i] = self.H[:, i + k, i]
        weights = ties.smoothness**2
        for first, second in combinations_with_replacement(range(REACH + 1), 2):
            at = slice(first, first + len(weights))
            band[(second - first) * D, at] += _BEND[first] * _BEND[second] * weights
        g = self.g + spread(weights * ties.accelerations, T)
        if len(ties.rush):
            fast = np.where(ties.rush != 0, ties.rush_weight**2, 0.0)
            band[0, :-1] += fast
            band[0, 1:] += fast
            band[D, :-1] -= fast
            g[:-1] -= ties.rush_weight**2 * ties.rush
            g[1:] += ties.rush_weight**2 * ties.rush
        held = limits * g < 0
        band[0] += np.where(held, _IMMOVABLE, damping[:, None])
        step = solveh_banded(
            band.reshape(REACH * D + 1, T * D),
            np.where(held, 0.0, g).ravel(),
            lower=True,
            overwrite_ab=True,
            check_finite=False,
        )
        return -step.reshape(T, D)


@dataclass(frozen=True, eq=False)
class Ties:
    """What ties frames to their neighbours: weighted squares of `accelerations`, the columns'
    second differences (A = T - 2), and of `rush`, by how much their first differences (V = T - 1)
    are too large; 0 where they are not."""

    smoothness: Float[np.ndarray, "A D"]
    accelerations: Float[np.ndarray, "A D"]
    rush_weight: Float[np.ndarray, "V 1"]
    rush: Float[np.ndarray, "V D"]

    def cost(self, frames: int) -> Float[np.ndarray, "T"]:
        """Half the weighted squares, told by frame."""
        out = np.zeros(frames)
        if len(self.accelerations):
            out[1:-1] += 0.5 * ((self.smoothness * self.accelerations) ** 2).sum(1)
        if len(self.rush):
            out[1:] += 0.5 * ((self.rush_weight * self.rush) ** 2).sum(1)
        return out


def _runs(columns: Sequence[int]) -> list[tuple[slice, slice]]:
    """Columns that follow each other, as slices of the list and of what it indexes."""
    breaks = np.flatnonzero(np.diff(columns) != 1) + 1
    edges = [0, *breaks.tolist(), len(columns)]
    return [(slice(a, b), slice(columns[a], columns[a] + b - a)) for a, b in pairwise(edges)]


def second_differences(values: Float[np.ndarray, "T *n"]) -> Float[np.ndarray, "A *n"]:
    """Over the first axis; empty for fewer than three."""
    if len(values) < 3:
        return np.zeros((0, *values.shape[1:]))
    return values[2:] - 2 * values[1:-1] + values[:-2]


def spread(accelerations: Float[np.ndarray, "A D"], frames: int) -> Float[np.ndarray, "T D"]:
    """The transpose of `second_differences`."""
    out = np.zeros((frames, accelerations.shape[1]))
    if len(accelerations):
        out[:-2] += accelerations
        out[1:-1] -= 2 * accelerations
        out[2:] += accelerations
    return out
