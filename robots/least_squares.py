"""Gauss-Newton steps over whole trajectories: one frame's normal equations, coupled by smoothness.

The unknowns are a step in D degrees of freedom (dofs) for each of T frames. A residual sees one
frame; only velocities and accelerations couple neighbours. So the normal equations are banded, with
a half-bandwidth of 2 D, and a banded Cholesky factorisation solves them in time linear in T (Golub
and Van Loan, "Matrix Computations", section 4.3).
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.linalg import solveh_banded

from robots.coupling import Smoothness

_HELD = 1e8  # damping that keeps a dof where it is: far above any weight squared
_NO_ROOM = 1e-9  # [rad, m]


def stopped(
    room: Float[np.ndarray, "2 T D"], gradient: Float[np.ndarray, "T D"]
) -> Bool[np.ndarray, "T D"]:
    """The dofs that have no `room` (the least and the largest step) where the gradient would take
    them."""
    least, largest = room
    return ((largest <= _NO_ROOM) & (gradient < 0)) | ((least >= -_NO_ROOM) & (gradient > 0))


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
        self._scatter(slice(None), dofs, H, (J @ residuals.T[:, :, None])[:, :, 0])

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
        self._scatter(frames, dofs, H, (twists @ sums[:, :, None])[:, :, 0])

    def _scatter(
        self,
        frames: slice | Int[np.ndarray, "S"],
        dofs: Sequence[int],
        H: Float[np.ndarray, "S C C"],
        g: Float[np.ndarray, "S C"],
    ) -> None:
        """Add products of a Jacobian by some of the dofs, in some frames."""
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
        smoothness: Smoothness,
        damping: Float[np.ndarray, "T"],
        room: Float[np.ndarray, "2 T D"],
        *,
        solves: int = 1,
    ) -> Float[np.ndarray, "T D"]:
        """The Gauss-Newton step of all frames together, `smoothness` included; `damping` is added
        to H's diagonal. `room` is the least and the largest step of each dof. Those without any do
        not move where the gradient would take them beyond it; and in each of the `solves` after the
        first, those that would go farther in the one before stop at its end, and the others step
        beside them: if they were only clipped after it, what others do in their turn would be in
        vain."""
        T, D = self.g.shape
        band, g = smoothness.band(self.H), self.g + smoothness.gradient(T)
        held = stopped(room, g)
        diagonal, asked = band[..., 0].copy(), np.where(held, 0.0, g)
        for k in range(solves):
            band[..., 0] = diagonal + np.where(held, _HELD, damping[:, None])
            step = -solveh_banded(
                band.reshape(T * D, -1).T,
                asked.ravel(),
                lower=True,
                overwrite_ab=k == solves - 1,
                check_finite=False,
            ).reshape(T, D)
            stops = np.clip(step, *room)
            beyond = ~held & (step != stops)
            if not beyond.any():
                break
            held |= beyond
            asked = np.where(beyond, -_HELD * stops, asked)
        return step


def runs(dofs: Sequence[int]) -> list[tuple[slice, slice]]:
    """Dofs that follow each other, as slices of the list and of what it indexes."""
    breaks = np.flatnonzero(np.diff(dofs) != 1) + 1
    edges = [0, *breaks.tolist(), len(dofs)]
    return [(slice(a, b), slice(dofs[a], dofs[a] + b - a)) for a, b in pairwise(edges)]
