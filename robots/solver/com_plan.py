"""A path of the centre of mass that the floor can give, planned before the whole body follows it.

In flight the path falls freely. On the floor it only has to be pushed, never pulled, and its centre
of pressure (Vukobratovic's zero-moment point; Kajita et al. 2003, eq. 3) lies inside the convex
hull of what touches. Within that it stays near a reference, with accelerations near natural ones.
Nothing looks at what follows a clip, or comes before it: so that the path doesn't fall there, its
extrapolated centre of mass (Hof et al. 2005, eq. 5), where it would come to stand, ends in that
hull, or on the way from there to where the reference's ends.

The height is planned first, since the centre of pressure is linear in the rest once the height is
known: two convex problems whose normal equations have seven diagonals. Pushing is an active set of
rows; the hull is a projection, alternated with the least squares (ADMM; Boyd et al. 2011, section
3.1).
"""

import numpy as np
from jaxtyping import Bool, Float
from scipy.linalg import cho_solve_banded, cholesky_banded

from robots.solver.support import Hulls, Support
from spark.constants import GRAVITY

NATURAL_CUTOFF = 0.8  # [Hz] above which accelerations are natural ones, below which the reference's
SMOOTH_CUTOFF = 3.0  # [Hz] above which the plan has no jerk that the reference lacks
W_FREE_FALL = 0.8  # [s²/m]: 1 m/s² off is as bad as 0.8 m off the path
W_PRESSURE = 4.0  # [1] of a metre that the centre of pressure lies outside the hull, or an end
MIN_PUSH = 0.15  # [body weights] that the floor gives where anything touches it
_ROUNDS = 24  # of the projection
_PUSH_ROUNDS = 12  # of the active set


def plan_com(
    reference: Float[np.ndarray, "T 3"],
    natural: Float[np.ndarray, "T 3"],
    momentum_rate: Float[np.ndarray, "T 2"],
    support: Support,
    frame_time: float,
) -> Float[np.ndarray, "T 3"]:
    """The centre of mass [m, floor at z = 0].

    `natural` are the accelerations [m/s²] that it would like to have, `momentum_rate` [m²/s²] how
    fast the angular momentum about X and Y grows, for unit mass. A clip of fewer than five frames
    is its own plan.
    """
    if len(reference) < 5:
        return reference.copy()
    out = reference.copy()
    out[:, 2] = _plan_height(reference[:, 2], natural[:, 2], support.flight, frame_time)
    push = np.maximum(_accelerations(out[:, 2], frame_time) + GRAVITY, MIN_PUSH * GRAVITY)
    # p = c - z / (z'' + g) c'' + (-L_y', L_x') / (z'' + g), for unit mass, z over the ground.
    lever = (out[:, 2] - support.height) / push
    offset = np.stack([-momentum_rate[:, 1], momentum_rate[:, 0]], axis=1) / push[:, None]
    out[:, :2] = _plan_path(
        reference[:, :2], natural[:, :2], out[:, 2], lever, offset, support, frame_time
    )
    return out


def _plan_height(
    z: Float[np.ndarray, "T"],
    natural: Float[np.ndarray, "T"],
    flight: Bool[np.ndarray, "T"],
    frame_time: float,
) -> Float[np.ndarray, "T"]:
    own = _accelerations(z, frame_time)
    least = -(1 - MIN_PUSH) * GRAVITY
    wanted = np.where(flight, -GRAVITY, least)
    bound = flight.copy()
    moved = np.zeros_like(z)
    for _ in range(_PUSH_ROUNDS):
        problem = _Banded(len(z), frame_time)
        problem.add(0.0, 1.0, _natural_weight(len(z)))
        weight = np.where(bound, W_FREE_FALL, 0.0)
        problem.add(0.0, 1.0, weight)
        rows = _natural_weight(len(z)) ** 2 * (natural - own) + weight**2 * (wanted - own)
        moved = problem.solve(problem.transposed(0.0, 1.0, rows))
        pulled = ~bound & (own + _accelerations(moved, frame_time) < least - 1e-6)
        if not pulled.any():
            break
        bound |= pulled
    return z + moved


def _plan_path(
    xy: Float[np.ndarray, "T 2"],
    natural: Float[np.ndarray, "T 2"],
    height: Float[np.ndarray, "T"],
    lever: Float[np.ndarray, "T"],
    offset: Float[np.ndarray, "T 2"],
    support: Support,
    frame_time: float,
) -> Float[np.ndarray, "T 2"]:
    T, flight = len(xy), support.flight
    ends = np.sqrt((height - support.height)[[0, -1]].clip(0.0) / GRAVITY) / frame_time
    own = _accelerations(xy, frame_time)
    soft, fall = _natural_weight(T), np.where(flight, W_FREE_FALL, 0.0)
    press = np.where(flight, 0.0, W_PRESSURE)
    problem = _Banded(T, frame_time)
    problem.add(0.0, 1.0, soft)
    problem.add(0.0, 1.0, fall)
    problem.add(1.0, -lever, press)
    problem.add_ends(ends, W_PRESSURE)
    free = (soft**2)[:, None] * (natural - own) - (fall**2)[:, None] * own
    fixed = problem.transposed(0.0, 1.0, free)
    pressure = xy - lever[:, None] * own + offset  # of the reference
    stands = _extrapolated(xy, ends)
    hull, last = Hulls(support), Hulls(support.at_ends(stands))
    moved, dual, dual_stand = np.zeros_like(xy), np.zeros_like(xy), np.zeros_like(stands)
    for _ in range(_ROUNDS):
        place = pressure + moved - lever[:, None] * _accelerations(moved, frame_time)
        inside = np.where(flight[:, None], place, hull.nearest(place + dual))
        dual = np.where(flight[:, None], 0.0, dual + place - inside)
        rows = (press**2)[:, None] * (inside - dual - pressure)
        place_stand = stands + _extrapolated(moved, ends)
        inside_stand = last.nearest(place_stand + dual_stand)
        dual_stand += place_stand - inside_stand
        outer = W_PRESSURE**2 * (inside_stand - dual_stand - stands)
        right = problem.transposed(1.0, -lever, rows) + problem.transposed_ends(ends, outer)
        moved = problem.solve(fixed + right)
    return xy + moved


def _extrapolated(
    x: Float[np.ndarray, "T 2"], ends: Float[np.ndarray, "2"]
) -> Float[np.ndarray, "2 2"]:
    """Where a pendulum of the time `ends` [frames] comes to stand after the last frame, and came
    from before the first."""
    outer: Float[np.ndarray, "2 2"] = x[[0, -1]] + ends[:, None] * (x[[0, -1]] - x[[1, -2]])
    return outer


def _natural_weight(frames: int) -> Float[np.ndarray, "T"]:
    """[s²/m] at which an acceleration at `NATURAL_CUTOFF` weighs as much as its path."""
    return np.full(frames, 1 / (2 * np.pi * NATURAL_CUTOFF) ** 2)


def _accelerations(x: Float[np.ndarray, "T *n"], frame_time: float) -> Float[np.ndarray, "T *n"]:
    """Second differences, those of the ends repeated."""
    inner = (x[2:] - 2 * x[1:-1] + x[:-2]) / frame_time**2
    return np.concatenate([inner[:1], inner, inner[-1:]])


class _Banded:
    """Least squares for a path x: it is near 0 and without jerk, and rows w (a x + b x'' - c)."""

    def __init__(self, frames: int, frame_time: float) -> None:
        self.frame_time = frame_time
        self.band = np.zeros((4, frames))
        self.band[0] = 1.0
        weight = 1 / (2 * np.pi * SMOOTH_CUTOFF * frame_time) ** 6
        jerk = (-1.0, 3.0, -3.0, 1.0)
        for i, first in enumerate(jerk):
            for j, second in enumerate(jerk[i:]):
                self.band[j, i : frames - 3 + i] += weight * first * second
        self._factor: Float[np.ndarray, "4 T"] | None = None

    def add(
        self,
        position: float,
        acceleration: float | Float[np.ndarray, "T"],
        weight: Float[np.ndarray, "T"],
    ) -> None:
        """Rows at the inner frames."""
        row = self._row(position, acceleration)
        squared, count = weight[1:-1] ** 2, len(weight) - 2
        for i in range(3):
            for j in range(i, 3):
                self.band[j - i, i : i + count] += squared * row[i] * row[j]

    def add_ends(self, ends: Float[np.ndarray, "2"], weight: float) -> None:
        """Rows w (x + t x') of the last frame, and of the first as time runs back; t [frames]."""
        for end, inner, time in zip((0, -1), (1, -2), ends, strict=True):
            self.band[0, end] += (weight * (1 + time)) ** 2
            self.band[0, inner] += (weight * time) ** 2
            self.band[1, min(end, inner)] -= weight**2 * (1 + time) * time

    def transposed_ends(
        self, ends: Float[np.ndarray, "2"], values: Float[np.ndarray, "2 n"]
    ) -> Float[np.ndarray, "T n"]:
        """`transposed` of these rows."""
        out = np.zeros((self.band.shape[1], values.shape[1]))
        out[[0, -1]] += (1 + ends)[:, None] * values
        out[[1, -2]] -= ends[:, None] * values
        return out

    def transposed(
        self,
        position: float,
        acceleration: float | Float[np.ndarray, "T"],
        values: Float[np.ndarray, "T *n"],
    ) -> Float[np.ndarray, "T *n"]:
        """Such rows, transposed, times values: the right-hand side for w² c."""
        out, count = np.zeros_like(values), len(values) - 2
        for i, row in enumerate(self._row(position, acceleration)):
            out[i : i + count] += (values[1:-1].T * row).T
        return out

    def solve(self, right: Float[np.ndarray, "T *n"]) -> Float[np.ndarray, "T *n"]:
        """The path."""
        if self._factor is None:
            self._factor = cholesky_banded(self.band, lower=True, check_finite=False)
        solved: Float[np.ndarray, T * n] = cho_solve_banded(
            (self._factor, True), right, check_finite=False
        )
        return solved

    def _row(
        self, position: float, acceleration: float | Float[np.ndarray, "T"]
    ) -> tuple[Float[np.ndarray, "*A"], Float[np.ndarray, "*A"], Float[np.ndarray, "*A"]]:
        b = np.broadcast_to(acceleration, self.band.shape[1])[1:-1] / self.frame_time**2
        return b, position - 2 * b, b
