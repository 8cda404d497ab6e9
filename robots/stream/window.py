"""Gauss-Newton over the last few frames of a robot's trajectory."""

import mujoco
import numpy as np
from jaxtyping import Float
from scipy.linalg.lapack import dposv

from robots.model.morphology import Morphology
from robots.solver.hinges import Posture
from robots.solver.near_spheres import NearSpheres
from robots.solver.repair import MAX_SINKING
from robots.solver.window_poses import WindowPoses
from robots.solver.window_targets import PointTargets
from robots.solver.window_terms import Terms
from robots.stream.coupling import Coupling
from robots.stream.firmness import MAX_OVERSPEED, Firmness
from robots.stream.frame_targets import FrameTargets
from robots.stream.prediction import TargetMotion

_DAMPING = 1e-3  # [1] on the diagonal of the normal equations,
_LONE_DAMPING = 0.02  # where frames are not coupled,
_HELD = 1e8  # and at a limit
_MAX_STEP = 0.2  # [rad, m] of a dof in one step
_MAX_ITER = 2  # steps a frame, at most
_STEP_TOL = 0.1  # [rad, m] after a shorter step there is no further one


class Window:
    """Solves for the last frames of a trajectory of qpos: `free` frames, coupled by their jerk and
    the base's acceleration to each other, to the `fixed` ones before them and to what may come."""

    def __init__(
        self, robot: Morphology, terms: Terms, frame_time: float, *, fixed: int, free: int
    ) -> None:
        self._terms, self._free = terms, free
        self._model = robot.mjcf.model
        self._data, self._root = mujoco.MjData(self._model), robot.mjcf.root
        self._dofs = terms.mj_dofs
        self._motion = TargetMotion(self._model, self._dofs, frame_time)
        self._coupling = Coupling(robot, frame_time, fixed=fixed, free=free)
        self._firmness = Firmness(free)
        self._max_sinking = MAX_SINKING * robot.rig.hip_height
        self._max_overspeed = MAX_OVERSPEED * frame_time

    def reset(self) -> None:
        """Forget what has been seen."""
        self._motion.reset()
        self._coupling.reset()
        self._firmness.reset()

    def solve(
        self,
        q: Float[np.ndarray, "T nq"],
        poses: WindowPoses,
        targets: FrameTargets,
        foot_targets: PointTargets,
        resting: PointTargets | None,
        posture: Posture,
    ) -> Float[np.ndarray, "T nq"]:
        """`q` after at most `_MAX_ITER` steps of its free frames, which have these targets, and
        are in these poses at first."""
        candidates = self._terms.candidates(poses.at(slice(-1, None)))
        self._coupling.follow(targets.com[-1] - targets.com[-2])
        overspeed = np.abs(self._coupling.overspeed(self._steps(q)))[-self._free :].max(axis=1)
        sinking = self._terms.sinking(poses)
        self._firmness.move_on(
            np.maximum(sinking / self._max_sinking, overspeed / self._max_overspeed)
        )
        for k in range(_MAX_ITER):
            if k:
                poses = self._terms.poses(q[-self._free :])
            q, length = self._step(q, poses, targets, foot_targets, resting, posture, candidates)
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
    ) -> Float[np.ndarray, "T nq"]:
        """`q` with its free frames after some steps, each frame for itself."""
        for _ in range(steps):
            poses = self._terms.poses(q[-self._free :])
            candidates = self._terms.candidates(poses.at(slice(-1, None)))
            q, _ = self._step(
                q,
                poses,
                targets,
                foot_targets,
                resting,
                self._terms.hinges.at_tpose,
                candidates,
                lone_damping=_LONE_DAMPING,
            )
        return q

    def _step(
        self,
        q: Float[np.ndarray, "T nq"],
        poses: WindowPoses,
        targets: FrameTargets,
        foot_targets: PointTargets,
        resting: PointTargets | None,
        posture: Posture,
        candidates: NearSpheres,
        *,
        lone_damping: float | None = None,
    ) -> tuple[Float[np.ndarray, "T nq"], float]:
        """One Gauss-Newton step, and its largest entry [rad, m]; with `lone_damping`, frames are
        not coupled, and damped by so much."""
        model, free = self._model, self._free
        scale = self._firmness.scale
        H, g = self._terms.linearize(
            q[-free:], poses, targets, foot_targets, posture, candidates, scale, resting
        )
        D = g.shape[1]
        whole = np.zeros((free * D, free * D))
        blocks = whole.reshape(free, D, free, D)
        for t in range(free):
            blocks[t, :, t] = H[t]
        if lone_damping is None:
            ahead = self._motion.of(q[-1], H[-1], g[-1])
            com, jacobian = self._center_of_mass(q)
            com_steps = np.diff(com, axis=0)
            self._coupling.add_to(self._steps(q), com_steps, jacobian, ahead, scale, blocks, g)
        held = self._terms.hinges.held(q[-free:], g)
        g[held] = 0.0
        whole.reshape(-1)[:: free * D + 1] += np.where(
            held, _HELD, lone_damping or _DAMPING
        ).ravel()
        _, step, _ = dposv(whole.T, g.ravel(), overwrite_a=True)
        length = float(np.abs(step).max())
        moved = np.zeros((free, model.nv))
        moved[:, self._dofs] = -min(1.0, _MAX_STEP / max(length, 1e-9)) * step.reshape(free, D)
        q = q.copy()
        for t in range(free):
            mujoco.mj_integratePos(model, q[t - free], moved[t], 1.0)
        self._terms.hinges.clip(q)
        return q, length

    def _steps(self, q: Float[np.ndarray, "T nq"]) -> Float[np.ndarray, "V D"]:
        """The dofs' steps from frame to frame."""
        steps = np.empty((len(q) - 1, self._model.nv))
        for t in range(len(q) - 1):
            mujoco.mj_differentiatePos(self._model, steps[t], 1.0, q[t], q[t + 1])
        return steps[:, self._dofs]

    def _center_of_mass(
        self, q: Float[np.ndarray, "T nq"]
    ) -> tuple[Float[np.ndarray, "T 3"], Float[np.ndarray, "F 3 D"]]:
        """Where it is [m, world], and by how much the dofs of the free frames move it."""
        model, data, root = self._model, self._data, self._root
        com, jacobian = np.empty((len(q), 3)), np.empty((self._free, 3, model.nv))
        fixed = len(q) - self._free
        for t in range(len(q)):
            data.qpos = q[t]
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            com[t] = data.subtree_com[root]
            if t >= fixed:
                mujoco.mj_jacSubtreeCom(model, data, jacobian[t - fixed], root)
        return com, jacobian[:, :, self._dofs]
