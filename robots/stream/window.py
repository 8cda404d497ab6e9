"""Gauss-Newton over the last few frames of a robot's trajectory."""

import mujoco
import numpy as np
from jaxtyping import Float
from scipy.linalg.lapack import dposv

from robots.model.morphology import Morphology
from robots.solver.hinges import Posture
from robots.solver.repair import MAX_SINKING
from robots.solver.window_dofs import as_slice
from robots.solver.window_poses import WindowPoses
from robots.solver.window_targets import PointTargets
from robots.solver.window_terms import Terms
from robots.stream.coupling import Coupling
from robots.stream.frame_targets import FrameTargets
from robots.stream.penalty_scale import MAX_OVERSPEED, PenaltyScale
from robots.stream.prediction import TargetMotion

_DAMPING = 1e-3  # [1] on the diagonal of the normal equations,
_LONE_DAMPING = 0.02  # where frames are not coupled,
_HELD = 1e8  # and at a limit
_MAX_STEP = 0.2  # [rad, m] of a dof in one step
_MAX_ITER = 2  # steps a frame, at most
MAX_FIRST_SPEED = 12.0  # [rad/s, m/s] of a dof with which a stream begins
_FIRST_STEPS = 5  # of each of a stream's first frames, to where its targets have it
_STEP_TOL = 0.1  # [rad, m] after a shorter step there is no further one


class Window:
    """Solves for the last frames of a trajectory of qpos: `free` frames, coupled by their jerk and
    the base's acceleration to each other, to the `fixed` ones before them and to what may come."""

    def __init__(
        self, robot: Morphology, terms: Terms, frame_time: float, *, fixed: int, free: int
    ) -> None:
        self._terms, self._fixed, self._free = terms, fixed, free
        self._model, self._dofs = robot.mjcf.model, as_slice(terms.mj_dofs)
        self._com: Float[np.ndarray, "fixed 3"]  # in the fixed frames [m]
        self._motion = TargetMotion(self._model, terms.mj_dofs, frame_time)
        self._coupling = Coupling(robot, frame_time, fixed=fixed, free=free)
        self._penalty = PenaltyScale(free)
        self._max_sinking = MAX_SINKING * robot.rig.hip_height
        self._frame_time = frame_time
        self._max_overspeed = MAX_OVERSPEED * frame_time
        self.reset()

    def reset(self) -> None:
        """Forget what has been seen."""
        self._com = np.zeros((0, 3))
        self._motion.reset()
        self._coupling.reset()
        self._penalty.reset()

    def move_on(self, q: Float[np.ndarray, "T nq"]) -> WindowPoses:
        """Take in that frames are one later and at `q`; the poses of the free ones."""
        com = self._terms.com(q[self._fixed - 1])[None]
        before = self._com[1:] if len(self._com) else com.repeat(self._fixed - 1, axis=0)
        self._com = np.concatenate([before, com])
        return self._terms.poses(q[self._fixed :], with_mass=True)

    def solve(
        self,
        q: Float[np.ndarray, "T nq"],
        poses: WindowPoses,
        targets: FrameTargets,
        foot_targets: PointTargets,
        resting: PointTargets | None,
        posture: Posture,
        ground: Float[np.ndarray, "F P"],
    ) -> Float[np.ndarray, "T nq"]:
        """`q` after at most `_MAX_ITER` steps of its free frames, which have these targets, and
        are in these poses at first; soles are over `ground` [m]."""
        terms, free = self._terms, self._free
        candidates = terms.candidates(poses.at(slice(-1, None)))
        asked = terms.asked(targets, foot_targets, resting)
        self._coupling.follow(targets.com[-1] - targets.com[-2])
        low, steps = terms.low(poses, ground), self._steps(q)
        overspeed = np.maximum.reduce(self._coupling.overspeed(steps[-free:]), axis=1)
        sinking = np.maximum.reduce(low.depth, axis=1, initial=-np.inf)
        self._penalty.move_on(
            np.maximum(sinking / self._max_sinking, overspeed / self._max_overspeed)
        )
        for k in range(_MAX_ITER):
            if k:
                poses = terms.poses(q[-free:], with_mass=True)
                low, steps = terms.low(poses, ground), self._steps(q)
            scale = self._penalty.scale
            H, g = terms.linearize(q[-free:], poses, asked, posture, candidates, scale, low)
            whole, g = self._coupled(q, steps, poses, H, g)
            q, length = self._moved(q, whole, g, _DAMPING)
            if length < _STEP_TOL:
                break
        self._motion.next()
        return q

    def settle(
        self,
        q: Float[np.ndarray, "T nq"],
        targets: FrameTargets,
        foot_targets: PointTargets,
        resting: PointTargets | None,
        steps: int,
        *,
        until: float = 0.0,
    ) -> Float[np.ndarray, "T nq"]:
        """`q` with its last frames, those that have targets, after so many steps, or a step shorter
        than `until` [rad, m], each frame for itself."""
        terms, count = self._terms, len(targets.hips)
        scale = self._penalty.scale[-count:]
        asked = terms.asked(targets, foot_targets, resting)
        for _ in range(steps):
            free = q[-count:]
            poses = terms.poses(free)
            candidates = terms.candidates(poses.at(slice(-1, None)))
            H, g = terms.linearize(free, poses, asked, terms.hinges.at_tpose, candidates, scale)
            q, length = self._moved(q, self._whole(H), g, _LONE_DAMPING)
            if length < until:
                break
        return q

    def set_in_motion(
        self,
        q: Float[np.ndarray, "T nq"],
        targets: FrameTargets,
        foot_targets: PointTargets,
        resting: PointTargets | None,
    ) -> Float[np.ndarray, "T nq"]:
        """`q` of a stream whose first frames are the free ones: all dofs move evenly from before
        these on, as their targets do, or not at all where they would be too fast for a motion:
        from a T-pose, maybe, a source jumps."""
        lone = self.settle(q, targets, foot_targets, resting, _FIRST_STEPS)
        step, last = np.empty(self._model.nv), self._free - 1
        mujoco.mj_differentiatePos(self._model, step, last, lone[-self._free], lone[-1])
        step = self._without_jumps(step)
        lone[:] = lone[self._fixed]
        for t, frame in enumerate(lone):
            mujoco.mj_integratePos(self._model, frame, step, t - self._fixed)
        self._terms.hinges.clip(lone)
        before = lone[[0, *range(self._fixed - 1)]]
        self._com = np.array([self._terms.com(q) for q in before])
        self._motion.set_in_motion(lone[:-1])
        self._coupling.set_in_motion(self._without_jumps((targets.com[-1] - targets.com[0]) / last))
        return lone

    def _without_jumps(self, step: Float[np.ndarray, "N"]) -> Float[np.ndarray, "N"]:
        return np.where(np.abs(step) > MAX_FIRST_SPEED * self._frame_time, 0.0, step)

    def _whole(self, H: Float[np.ndarray, "F D D"]) -> Float[np.ndarray, "F D F D"]:
        """The normal equations of frames that nothing couples."""
        frames, dofs, _ = H.shape
        whole = np.zeros((frames, dofs, frames, dofs))
        np.einsum("tdte->tde", whole)[:] = H
        return whole

    def _coupled(
        self,
        q: Float[np.ndarray, "T nq"],
        steps: Float[np.ndarray, "V D"],
        poses: WindowPoses,
        H: Float[np.ndarray, "F D D"],
        g: Float[np.ndarray, "F D"],
    ) -> tuple[Float[np.ndarray, "F D F D"], Float[np.ndarray, "F D"]]:
        """The normal equations of the free frames, in `poses` and with H and g of their own, with
        what couples them to each other and to the fixed ones; `steps` are the dofs' from frame to
        frame."""
        assert poses.com_jacobian is not None
        ahead = self._motion.of(q[-1], H[-1], g[-1])
        com = np.concatenate([self._com, poses.com])
        com_steps, scale = com[1:] - com[:-1], self._penalty.scale
        whole, coupled = self._coupling.normal_equations(
            steps, com_steps, poses.com_jacobian, ahead, scale
        )
        own = np.einsum("tdte->tde", whole)  # a view
        own += H
        coupled += g
        return whole, coupled

    def _moved(
        self,
        q: Float[np.ndarray, "T nq"],
        whole: Float[np.ndarray, "F D F D"],
        g: Float[np.ndarray, "F D"],
        damping: float,
    ) -> tuple[Float[np.ndarray, "T nq"], float]:
        """`q` after one Gauss-Newton step, and the step's largest entry [rad, m]."""
        free = len(g)
        q, g = q.copy(), g.ravel()
        diagonal = whole.reshape(-1)[:: g.size + 1]
        diagonal += damping
        (held,) = self._terms.hinges.held(q[-free:], g.reshape(free, -1)).ravel().nonzero()
        g[held] = 0.0
        diagonal[held] += _HELD
        _, step, _ = dposv(whole.reshape(g.size, -1).T, g, lower=True, overwrite_a=True)
        length = max(float(np.maximum.reduce(step)), -float(np.minimum.reduce(step)))
        moved = np.zeros((free, self._model.nv))
        step *= -min(1.0, _MAX_STEP / max(length, 1e-9))
        moved[:, self._dofs] = step.reshape(free, -1)
        for t in range(free):
            mujoco.mj_integratePos(self._model, q[t - free], moved[t], 1.0)
        self._terms.hinges.clip(q[-free:])
        return q, length

    def _steps(self, q: Float[np.ndarray, "T nq"]) -> Float[np.ndarray, "V D"]:
        """The dofs' steps from frame to frame."""
        steps = np.empty((len(q) - 1, self._model.nv))
        for t in range(len(q) - 1):
            mujoco.mj_differentiatePos(self._model, steps[t], 1.0, q[t], q[t + 1])
        return steps[:, self._dofs]
