"""Gauss-Newton over the last few frames of a robot's trajectory."""

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.linalg.lapack import dposv

from robots.model.morphology import Morphology
from robots.solver import objective
from robots.solver.descent import LIMIT_CLEARANCE
from robots.solver.objective import MAX_HINGE_SPEED, W_OVERSPEED
from robots.solver.smoothness import acceleration_weights
from robots.stream.frame_targets import FrameTargets
from robots.stream.terms import FootTargets, Posture, Terms

SMOOTH_CUTOFF = (
    5.5  # [Hz] above which a motion fades: more than in hindsight, or it would lag behind
)
_DAMPING = 1e-3
_LONE_DAMPING = 0.02  # where nothing else keeps steps small
_FIXED_DAMPING = 1e8
_MAX_STEP = 0.2  # [rad, m] a column moves in one step
_MAX_ITER = 2  # at most,
_STEP_TOL = 0.1  # [rad, m] and none after one that is shorter


class Window:
    """Solves for the last frames of a trajectory in `qpos`: `free` ones, after some that are
    `fixed`, which they are tied to."""

    def __init__(
        self, robot: Morphology, terms: Terms, frame_time: float, *, fixed: int, free: int
    ) -> None:
        self._terms, self._frame_time, self._free = terms, frame_time, free
        self._model, tree = robot.mjcf.model, robot.tree
        starts = self._model.jnt_dofadr[list(robot.mj_joints)]
        base = int(self._model.jnt_dofadr[robot.mjcf.free_joint])
        dofs = [*range(base, base + 6)]
        for start, ball in zip(starts.tolist(), tree.balls, strict=True):
            dofs += range(start, start + (3 if ball else 1))
        self._dofs = np.array(dofs)
        hinges = ~tree.balls
        self._columns = tree.dof_starts[hinges]
        self._angles = self._model.jnt_qposadr[np.array(robot.mj_joints)[hinges]]
        lower, upper = tree.limits_within(LIMIT_CLEARANCE)
        rest = self._model.qpos0[self._angles]
        self._lower, self._upper = lower[hinges] + rest, upper[hinges] + rest
        # What ties frames together: as `robots.least_squares.Smoothness`, those that are gone
        # immovable.
        weights = (
            acceleration_weights(robot)
            * (objective.SMOOTH_CUTOFF / SMOOTH_CUTOFF / frame_time) ** 2
        )
        self._stiff = weights**2
        second, self._first = (np.diff(np.eye(fixed + free), k, axis=0)[:, fixed:] for k in (2, 1))
        self._second = second
        self._ties = np.kron(second.T @ second, np.diag(self._stiff))
        self._rush = (W_OVERSPEED / frame_time) ** 2
        self._most = np.full(tree.nv, np.inf)
        self._most[self._columns] = MAX_HINGE_SPEED * frame_time

    def solve(
        self,
        q: Float[np.ndarray, "T nq"],
        targets: FrameTargets,
        foot_targets: FootTargets,
        posture: Posture,
    ) -> Float[np.ndarray, "T nq"]:
        """`q` with its free frames, those that have targets, as these and the others want them."""
        candidates = self._terms.candidates(q[-1:])
        for _ in range(_MAX_ITER):
            q, length = self._step(q, targets, foot_targets, posture, candidates)
            if length < _STEP_TOL:
                break
        return q

    def settle(
        self,
        q: Float[np.ndarray, "T nq"],
        targets: FrameTargets,
        foot_targets: FootTargets,
        steps: int,
    ) -> Float[np.ndarray, "T nq"]:
        """`q` with its free frames as their targets want them, each for itself."""
        for _ in range(steps):
            candidates = self._terms.candidates(q[-1:])
            q, _ = self._step(
                q, targets, foot_targets, self._terms.relaxed, candidates, alone=_LONE_DAMPING
            )
        return q

    def _step(
        self,
        q: Float[np.ndarray, "T nq"],
        targets: FrameTargets,
        foot_targets: FootTargets,
        posture: Posture,
        candidates: Int[np.ndarray, "K"],
        *,
        alone: float | None = None,
    ) -> tuple[Float[np.ndarray, "T nq"], float]:
        """One step, and how long it was; `alone`, damped by so much, without the ties."""
        model, free = self._model, self._free
        H, g = self._terms.linearize(q[-free:], targets, foot_targets, posture, candidates)
        D = g.shape[1]
        whole = self._ties * (alone is None)
        blocks = whole.reshape(free, D, free, D)
        for t in range(free):
            blocks[t, :, t] += H[t]
        if alone is None:
            self._tie(q, blocks, g)
        held = self._at_limits(q[-free:], g)
        g[held] = 0.0
        whole.reshape(-1)[:: free * D + 1] += np.where(
            held, _FIXED_DAMPING, alone or _DAMPING
        ).ravel()
        _, step, _ = dposv(whole.T, g.ravel(), overwrite_a=True)
        length = float(np.abs(step).max())
        moved = np.zeros((free, model.nv))
        moved[:, self._dofs] = -min(1.0, _MAX_STEP / max(length, 1e-9)) * step.reshape(free, D)
        q = q.copy()
        for t in range(free):
            mujoco.mj_integratePos(model, q[t - free], moved[t], 1.0)
        q[:, self._angles] = np.clip(q[:, self._angles], self._lower, self._upper)
        return q, length

    def _tie(
        self,
        q: Float[np.ndarray, "T nq"],
        blocks: Float[np.ndarray, "F D F D"],
        g: Float[np.ndarray, "F D"],
    ) -> None:
        """Add the pull of the accelerations, and hold back hinges that turn too fast."""
        steps = np.empty((len(q) - 1, self._model.nv))
        for t in range(len(q) - 1):
            mujoco.mj_differentiatePos(self._model, steps[t], 1.0, q[t], q[t + 1])
        steps = steps[:, self._dofs]
        g += self._stiff * (self._second.T @ (steps[1:] - steps[:-1]))
        haste = steps - np.clip(steps, -self._most, self._most)
        if haste.any():
            first, at = self._first, np.arange(g.shape[1])
            g += self._rush * (first.T @ haste)
            ties = np.einsum("vs,vt,vd->std", first, first, self._rush * (haste != 0))
            for s, t in np.ndindex(ties.shape[:2]):
                blocks[s, at, t, at] += ties[s, t]

    def _at_limits(
        self, q: Float[np.ndarray, "F nq"], g: Float[np.ndarray, "F D"]
    ) -> Bool[np.ndarray, "F D"]:
        """Hinges at their limits that would go beyond."""
        held = np.zeros(g.shape, dtype=bool)
        angles, push = q[:, self._angles], g[:, self._columns]
        below, above = angles <= self._lower + 1e-9, angles >= self._upper - 1e-9
        held[:, self._columns] = (above & (push < 0)) | (below & (push > 0))
        return held
