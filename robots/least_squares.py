"""Gauss-Newton steps over whole trajectories: one frame's normal equations, coupled by smoothness.

The unknowns are a step in D degrees of freedom (dofs) for each of T frames. A residual sees one
frame; only velocities and accelerations couple neighbours. So the normal equations are banded, with
a half-bandwidth of 2 D, and a banded Cholesky factorisation solves them in time linear in T (Golub
and Van Loan, "Matrix Computations", section 4.3).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement, pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.linalg import solveh_banded

_HELD = 1e8  # damping that keeps a dof where it is: far above any weight squared
COUPLED = 2  # an acceleration couples a frame to the next two
_SECOND_DIFFERENCE = (1.0, -2.0, 1.0)
_AT_ONCE = 16  # frames whose band fits into a processor's cache


class NormalEquations:
    """The normal equations `H step = -g` of weighted residuals r, a frame each, being summed up.

    H = J'J [T D D] and g = J'r [T D], J the Jacobian of r by the dofs; `cost` = r'r / 2 [T]. Of H
    the upper triangle says all; nothing else of it is read. With `with_jacobian` False only the
    cost is summed, and H and g are empty.
    """

    def __init__(self, frames: int, dofs: int, with_jacobian: bool = True) -> None:
        self.with_jacobian = with_jacobian
        self.H = np.zeros((frames, dofs, dofs) if with_jacobian else (0, 0, 0))
        self.g = np.zeros((frames, dofs) if with_jacobian else (0, 0))
        self.cost = np.zeros(frames)

    def add(
        self,
        dofs: Sequence[int],
        J: Float[np.ndarray, "T C M"],
        residuals: Float[np.ndarray, "M T"],
    ) -> None:
        """M weighted residuals a frame, and their transposed Jacobian by C of the dofs."""
        self.cost += 0.5 * np.einsum("mt,mt->t", residuals, residuals)
        if not self.with_jacobian or not len(dofs):
            return
        H = J @ J.transpose(0, 2, 1)
        g = (J @ residuals.T[:, :, None])[:, :, 0]
        slices = runs(dofs)
        for here, there in slices:
            self.g[:, there] += g[:, here]
            for here2, there2 in slices:
                if there2.start >= there.start:
                    self.H[:, there, there2] += H[:, here, here2]

    def add_moved(
        self,
        frames: Int[np.ndarray, "S"],
        dofs: Sequence[int],
        twists: Float[np.ndarray, "S C 6"],
        squares: Float[np.ndarray, "S 6 6"],
        sums: Float[np.ndarray, "S 6"],
    ) -> None:
        """Any number of residuals in S of the frames, all of one body that C of the dofs move by
        `twists` (`robots.residuals.twists`): with w the wrench that makes a residual's Jacobian of
        them, the sums of w w' (`squares`) and w r. What they cost is added by who knows them."""
        H = twists @ squares @ twists.transpose(0, 2, 1)
        g = (twists @ sums[:, :, None])[:, :, 0]
        slices = runs(dofs)
        for here, there in slices:
            self.g[frames, there] += g[:, here]
            for here2, there2 in slices:
                if there2.start >= there.start:
                    self.H[frames, there, there2] += H[:, here, here2]

    def add_products(
        self, products: Float[np.ndarray, "D D T"], gradient: Float[np.ndarray, "D T"]
    ) -> None:
        """To H and g, what others summed up."""
        self.H += products.transpose(2, 0, 1)
        self.g += gradient.T

    def add_diagonal(
        self, J: Float[np.ndarray, "T D"], residuals: Float[np.ndarray, "T D"]
    ) -> None:
        """One weighted residual a dof that depends on that dof alone; `J` is its derivative."""
        self.cost += 0.5 * (residuals**2).sum(1)
        if self.with_jacobian:
            at = np.arange(self.g.shape[1])
            self.H[:, at, at] += J**2
            self.g += J * residuals

    def blended(self, other: "NormalEquations", share: Float[np.ndarray, "T"]) -> "NormalEquations":
        """`1 - share` of these and `share` of the others, frame by frame."""
        out = NormalEquations(0, 0)
        out.H = self.H + share[:, None, None] * (other.H - self.H)
        out.g = self.g + share[:, None] * (other.g - self.g)
        out.cost = self.cost + share * (other.cost - self.cost)
        return out

    def replaced(self, frames: Int[np.ndarray, "S"], other: "NormalEquations") -> "NormalEquations":
        """With the S frames of the others in these frames' places."""
        out = NormalEquations(0, 0)
        out.H, out.g, out.cost = self.H.copy(), self.g.copy(), self.cost.copy()
        out.H[frames], out.g[frames], out.cost[frames] = other.H, other.g, other.cost
        return out

    def at(self, frames: Int[np.ndarray, "S"]) -> "NormalEquations":
        """Those of some frames."""
        out = NormalEquations(0, 0)
        out.H, out.g, out.cost = self.H[frames], self.g[frames], self.cost[frames]
        return out

    def hold(self, held: Bool[np.ndarray, "T D"]) -> None:
        """Keep some dofs from moving: their rows and columns become the identity's."""
        free = np.where(held, 0.0, 1.0)
        self.H *= free[:, :, None] * free[:, None]
        at = np.arange(free.shape[1])
        self.H[:, at, at] += 1.0 - free
        self.g *= free

    def solve_per_frame(self, damping: float) -> Float[np.ndarray, "T D"]:
        """The Gauss-Newton step of each frame for itself; `damping` is added to H's diagonal."""
        D = self.g.shape[1]
        H = np.triu(self.H) + np.triu(self.H, 1).transpose(0, 2, 1) + damping * np.eye(D)
        return -np.linalg.solve(H, self.g[..., None])[..., 0]

    def solve_coupled(
        self,
        smoothness: "Smoothness",
        damping: Float[np.ndarray, "T"],
        at_limits: Float[np.ndarray, "T D"],
        *,
        solves: int = 1,
    ) -> Float[np.ndarray, "T D"]:
        """The Gauss-Newton step of all frames together, `smoothness` included; `damping` is added
        to H's diagonal. Dofs that stand at their upper (`at_limits` +1) or lower limit (-1) do not
        move where the gradient would take them beyond it; nor, in more than one of the `solves`,
        where the step before would."""
        T, D = self.g.shape
        point = smoothness.point
        band = _band(self.H, point)
        weights = smoothness.acceleration_weights**2
        for first, second in combinations_with_replacement(range(COUPLED + 1), 2):
            at = slice(first, first + len(weights))
            product = _SECOND_DIFFERENCE[first] * _SECOND_DIFFERENCE[second]
            band[at, :, (second - first) * D] += product * weights
        g = self.g + second_differences_transposed(weights * smoothness.accelerations, T)
        if len(smoothness.overspeed):
            squared = smoothness.overspeed_weight**2
            fast = np.where(smoothness.overspeed != 0, squared, 0.0)
            band[:-1, :, 0] += fast
            band[1:, :, 0] += fast
            band[:-1, :, D] -= fast
            g[:-1] -= squared * smoothness.overspeed
            g[1:] += squared * smoothness.overspeed
        if point:
            g += point.gradient
        held = at_limits * g < 0
        diagonal = band[..., 0].copy()
        for k in range(solves):
            band[..., 0] = diagonal + np.where(held, _HELD, damping[:, None])
            step = -solveh_banded(
                band.reshape(T * D, -1).T,
                np.where(held, 0.0, g).ravel(),
                lower=True,
                overwrite_ab=k == solves - 1,
                check_finite=False,
            ).reshape(T, D)
            beyond = (at_limits * step > 0) & ~held
            if not beyond.any():
                break
            held |= beyond
        return step


@dataclass(frozen=True, eq=False)
class Smoothness:
    """What couples neighbouring frames: two weighted residuals a dof.

    r = `acceleration_weights` x `accelerations`, the dofs' second differences (A = T - 2), and
    r = `overspeed_weight` x `overspeed`, by how much their first differences (V = T - 1) exceed the
    fastest allowed; 0 where they do not.
    """

    acceleration_weights: Float[np.ndarray, "A D"]
    accelerations: Float[np.ndarray, "A D"]
    overspeed_weight: Float[np.ndarray, "V 1"]
    overspeed: Float[np.ndarray, "V D"]
    point: "PointAcceleration | None" = None

    def cut(self, starts: Int[np.ndarray, "S"]) -> "Smoothness":
        """Without what couples the frames from each of `starts` on to those before it."""
        accelerated, fast = self.acceleration_weights.copy(), self.overspeed_weight.copy()
        accelerated[starts - 1] = accelerated[starts - 2] = 0.0
        fast[starts - 1] = 0.0
        return replace(
            self,
            acceleration_weights=accelerated,
            overspeed_weight=fast,
            point=self.point.cut(starts) if self.point else None,
        )

    def cost(self, frames: int) -> Float[np.ndarray, "T"]:
        """Half the squares of the residuals: an acceleration's at its middle frame, an overspeed's
        at the later one."""
        out = np.zeros(frames)
        if len(self.accelerations):
            out[1:-1] += 0.5 * ((self.acceleration_weights * self.accelerations) ** 2).sum(1)
        if len(self.overspeed):
            out[1:] += 0.5 * ((self.overspeed_weight * self.overspeed) ** 2).sum(1)
        if self.point:
            out[1:-1] += 0.5 * (self.point.residual**2).sum(1)
        return out


@dataclass(frozen=True, eq=False)
class PointAcceleration:
    """A weighted residual r of a point's second differences, and w times its Jacobian by the dofs:
    r at t changes with the steps at t, t + 1 and t + 2 as the second difference of J step does. J
    is empty where only the cost counts."""

    J: Float[np.ndarray, "_ D 3"]
    residual: Float[np.ndarray, "A 3"]
    counts: Bool[np.ndarray, "A"]  # which of the residuals count

    def cut(self, starts: Int[np.ndarray, "S"]) -> "PointAcceleration":
        """Without what couples the frames from each of `starts` on to those before it."""
        residual, counts = self.residual.copy(), self.counts.copy()
        for across in (starts - 1, starts - 2):
            residual[across], counts[across] = 0.0, False
        return PointAcceleration(self.J, residual, counts)

    @property
    def ahead(self) -> Float[np.ndarray, "T 3 W"]:
        """What J is multiplied by to give J'J: the transposed Jacobian of each frame and of the
        next two, as often as they meet in a residual."""
        T, D = self.J.shape[:2]
        count = len(self.residual)
        products = np.zeros((COUPLED + 1, T))
        for first, second in combinations_with_replacement(range(COUPLED + 1), 2):
            product = _SECOND_DIFFERENCE[first] * _SECOND_DIFFERENCE[second]
            products[second - first, first : first + count] += product * self.counts
        out = np.zeros((T, 3, (COUPLED + 1) * D))
        for m in range(COUPLED + 1):
            later = self.J[m:] * products[m, : T - m, None, None]
            out[: T - m, :, m * D : (m + 1) * D] = later.transpose(0, 2, 1)
        return out

    @property
    def gradient(self) -> Float[np.ndarray, "T D"]:
        """J'r."""
        differences = second_differences_transposed(self.residual, len(self.J))
        return np.einsum("tdx,tx->td", self.J, differences)


def _band(
    H: Float[np.ndarray, "T D D"], point: PointAcceleration | None
) -> Float[np.ndarray, "T D K"]:
    """The lower band of each frame's H and of what a point's accelerations couple, column by
    column, as LAPACK reads it: [t, i, k] couples dof i at t to the k-th one after. It has room for
    what couples a dof to itself in the next two frames."""
    T, D = H.shape[:2]
    width = (COUPLED + 1) * D if point else COUPLED * D
    band = np.zeros((T, D, width + 1))
    # As each row begins with its own dof, a frame's rows are, in a line, those of a matrix that has
    # a column less: what couples it to itself and to the frames after.
    matrices = band.reshape(T, -1)[:, : D * width].reshape(T, D, width)
    upper, ahead = np.triu(np.ones((D, D))), point.ahead if point else None
    for start in range(0, T, _AT_ONCE):
        here = slice(start, start + _AT_ONCE)
        if point and ahead is not None:
            np.matmul(point.J[here], ahead[here], out=matrices[here])
        own = matrices[here, :, :D]
        own += H[here]
        own *= upper
    return band


def runs(dofs: Sequence[int]) -> list[tuple[slice, slice]]:
    """Dofs that follow each other, as slices of the list and of what it indexes."""
    breaks = np.flatnonzero(np.diff(dofs) != 1) + 1
    edges = [0, *breaks.tolist(), len(dofs)]
    return [(slice(a, b), slice(dofs[a], dofs[a] + b - a)) for a, b in pairwise(edges)]


def second_differences(values: Float[np.ndarray, "T *n"]) -> Float[np.ndarray, "A *n"]:
    """Over the first axis; empty for fewer than three."""
    if len(values) < 3:
        return np.zeros((0, *values.shape[1:]))
    return values[2:] - 2 * values[1:-1] + values[:-2]


def second_differences_transposed(
    values: Float[np.ndarray, "A D"], frames: int
) -> Float[np.ndarray, "T D"]:
    """The transpose of `second_differences`, as a matrix, times `values`."""
    out = np.zeros((frames, values.shape[1]))
    if len(values):
        out[:-2] += values
        out[1:-1] -= 2 * values
        out[2:] += values
    return out
