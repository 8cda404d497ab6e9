"""What couples the frames of a trajectory: its accelerations, what is too fast, and a point's path.

A residual of these sees a frame and one or two after it, so the normal equations are a band.
"""

from dataclasses import dataclass, replace
from itertools import combinations_with_replacement

import numpy as np
from jaxtyping import Bool, Float, Int

COUPLED = 2  # an acceleration couples a frame to the next two
_SECOND_DIFFERENCE = (1.0, -2.0, 1.0)
_AT_ONCE = 16  # frames whose band fits into a processor's cache


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

    def band(self, H: Float[np.ndarray, "T D D"]) -> Float[np.ndarray, "T D K"]:
        """The lower band of each frame's H with what couples it to the next, column by column, as
        LAPACK reads it: [t, i, k] couples dof i at t to the k-th one after."""
        D, band = H.shape[1], _band(H, self.point)
        weights = self.acceleration_weights**2
        for first, second in combinations_with_replacement(range(COUPLED + 1), 2):
            at = slice(first, first + len(weights))
            product = _SECOND_DIFFERENCE[first] * _SECOND_DIFFERENCE[second]
            band[at, :, (second - first) * D] += product * weights
        if len(self.overspeed):
            fast = np.where(self.overspeed != 0, self.overspeed_weight**2, 0.0)
            band[:-1, :, 0] += fast
            band[1:, :, 0] += fast
            band[:-1, :, D] -= fast
        return band

    def gradient(self, frames: int) -> Float[np.ndarray, "T D"]:
        """J'r."""
        weighted = self.acceleration_weights**2 * self.accelerations
        out = second_differences_transposed(weighted, frames)
        if len(self.overspeed):
            pushed = self.overspeed_weight**2 * self.overspeed
            out[:-1] -= pushed
            out[1:] += pushed
        if self.point:
            out += self.point.gradient
        return out

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
    """That of each frame's H and of a point's accelerations, with room for what couples a dof to
    itself in the next two frames."""
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
