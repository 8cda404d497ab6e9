"""What a stream's answer costs beyond its newest frame.

A window that ends at the newest frame spends there what smoothness will cost afterwards: its
answers run behind the source, overshoot, and jerk back. So each dof is taken to go on as its target
has last moved, ever slower, and the window's smoothness reaches over these frames too. They are not
solved for: of each dof they leave a quadratic in its last three frames, the cost to go of a
linear-quadratic tracker with preview (Anderson & Moore, Optimal Control, 4.3). It depends on one
number alone, the ratio of both weights, and is read from a table.
"""

from collections import deque
from typing import NamedTuple

import mujoco
import numpy as np
from jaxtyping import Float, Int
from scipy.linalg.lapack import dposv

from robots.solver.window_dofs import as_slice

HORIZON = 0.3  # [s] that is looked beyond the newest frame
SLOWING = 0.1  # [s] in which a target loses most of its speed
_SPEED_WINDOW = 0.05  # [s] before the newest frame over which that speed is measured
_DAMPING = 0.02  # [1] on the diagonal of the normal equations that say where a target is
_MAX_STEP = 0.5  # [rad, m] to it
_MAX_SPEED = 10.0  # [rad/s, m/s]
_BASE = slice(0, 3)  # dofs of the base's position
_LOG_RATIOS = np.linspace(-14.0, 21.0, 400)  # of a derivative's squared weight to the target's


class Ahead(NamedTuple):
    """Of the dofs of a stream's newest frame: how far from where they are their targets are [rad,
    m], how fast these move [rad/s, m/s], and how much they weigh, squared."""

    targets: Float[np.ndarray, "D"]
    speeds: Float[np.ndarray, "D"]
    weights: Float[np.ndarray, "D"]


class CostToGo:
    """Of dofs whose derivatives of an order, 2 or 3, are weighed (squared), frame by frame."""

    def __init__(
        self, frame_time: float, orders: Int[np.ndarray, "D"], weights: Float[np.ndarray, "D"]
    ) -> None:
        tables = np.stack([_table(frame_time, order) for order in (2, 3)])
        changes = np.diff(tables, axis=1, append=tables[:, -1:])
        self._rows = np.stack([tables, changes], axis=2).reshape(2 * len(_LOG_RATIOS), -1)
        self._first = (orders - 2) * len(_LOG_RATIOS)  # of the rows of each dof's table
        self._per_row = 1 / (_LOG_RATIOS[1] - _LOG_RATIOS[0])
        self._at_one = self._per_row * (np.log(weights) - _LOG_RATIOS[0])

    def of(self, weights: Float[np.ndarray, "D"]) -> Float[np.ndarray, "3 5 D"]:
        """P, and p by where the target is and how fast it moves, of `x P x / 2 + p x` in the last
        three values x of each dof, from its newest; targets weigh so much, squared."""
        at = self._at_one - self._per_row * np.log(np.maximum(weights, 1e-12))
        at = np.minimum(np.maximum(at, 0.0), len(_LOG_RATIOS) - 1.001)
        row = at.astype(int)
        share = at - row
        row += self._first
        cost, change = self._rows.take(row, axis=0).T.reshape(2, 15, -1)
        out: Float[np.ndarray, "15 D"] = (cost + share * change) * weights
        return out.reshape(3, 5, -1)


def _table(frame_time: float, order: int) -> Float[np.ndarray, "R 3 5"]:
    """P, and p for a target at 1 and for one that moves from 0 with a speed of 1, where the target
    weighs 1."""
    count = max(4, round(HORIZON / frame_time))
    differences = np.diff(np.eye(3 + count), order, axis=0)[3 - order :]
    weighed = np.exp(_LOG_RATIOS)[:, None, None] * (differences.T @ differences)
    time = frame_time * np.arange(1, count + 1)
    ways = np.stack([np.ones(count), SLOWING * (1 - np.exp(-time / SLOWING))], axis=1)
    across = weighed[:, 3:, :3]
    right = np.concatenate([across, np.broadcast_to(ways, (len(across), count, 2))], axis=2)
    out = across.transpose(0, 2, 1) @ np.linalg.solve(weighed[:, 3:, 3:] + np.eye(count), right)
    out[:, :, :3] = weighed[:, :3, :3] - out[:, :, :3]
    return out


class TargetMotion:
    """Where the dofs of a stream's newest frame should be if smoothness did not matter, and how
    fast that moves."""

    def __init__(
        self, model: mujoco.MjModel, dofs: Int[np.ndarray, "D"], frame_time: float
    ) -> None:
        self._model, self._dofs, self._frame_time = model, as_slice(dofs), frame_time
        self._sides = np.eye(len(dofs), 4, 1)  # the negative gradient's place, and the base's dofs
        self._past: deque[Float[np.ndarray, nq]] = deque(
            maxlen=max(1, round(_SPEED_WINDOW / frame_time))
        )
        self._now = np.zeros(model.nq)

    def of(
        self,
        q: Float[np.ndarray, "nq"],
        H: Float[np.ndarray, "D D"],
        g: Float[np.ndarray, "D"],
    ) -> Ahead:
        """What is expected of the dofs of `q`; H and g are the normal equations of that frame
        alone."""
        model = self._model
        damped = H.copy()
        damped.reshape(-1)[:: len(g) + 1] += _DAMPING
        sides = self._sides.copy("F")
        np.negative(g, out=sides[:, 0])
        _, solved, _ = dposv(damped.T, sides, overwrite_a=True, overwrite_b=True)
        target = np.minimum(np.maximum(solved[:, 0], -_MAX_STEP), _MAX_STEP)
        step, speeds = np.zeros((2, model.nv))
        step[self._dofs] = target
        self._now = q.copy()
        mujoco.mj_integratePos(model, self._now, step, 1.0)
        if self._past:
            time = len(self._past) * self._frame_time
            mujoco.mj_differentiatePos(model, speeds, time, self._past[0], self._now)
        speeds = np.minimum(np.maximum(speeds[self._dofs], -_MAX_SPEED), _MAX_SPEED)
        # Legs give way to the base where they bend: it weighs what is then left of its weight (a
        # Schur complement), over the floor alike in all directions. By H's diagonal it would be as
        # firm as if they could not bend.
        weights = H.reshape(-1)[:: len(g) + 1].copy()
        x, y, z = solved[0, 1], solved[1, 2], solved[2, 3]
        weights[_BASE] = 2 / (x + y), 2 / (x + y), 1 / z
        return Ahead(target, speeds, weights)

    def set_in_motion(self, past: Float[np.ndarray, "T nq"]) -> None:
        """Where the targets have been, in all frames before the newest."""
        self._past.extend(past)

    def next(self) -> None:
        """The newest frame is not the newest any more."""
        self._past.append(self._now)

    def reset(self) -> None:
        """Forget what has been seen."""
        self._past.clear()
