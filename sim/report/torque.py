"""Joint torques: what a robot's motors must give for a motion, against what they can.

Inverse dynamics of the model give the generalised forces that the motion needs. The floor gives
part of them, at the points near it and within friction cones. Which forces it gives at several
points is not determined by the motion: those are taken that explain the root's wrench and leave
the joints the least squares of torques, in shares of their limits. Other forces may ask less of the
joint that is loaded most.
"""

import copy
from dataclasses import dataclass
from functools import lru_cache

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.optimize import nnls

from sim.body.mj_joints import BALL, FREE, HINGE, hinges_and_balls, joint_name
from sim.physics.servos import torque_limit
from sim.report.derivatives import derivative
from sim.report.wrench import friction_edges
from sim.trajectory import ModelTrajectory
from spark.constants import GRAVITY
from spark.rotation import quat_conj, quat_continuous, quat_mul
from spark.summary import brief

# Of the root's wrench in the least squares: a torque at its limit counts as much as this share of
# the body's weight that nothing gives, so that the floor explains the root before it spares joints.
_SPARING = 0.01


@dataclass(frozen=True, eq=False)
class JointTorque:
    """The torque [N m] that a hinge needs in each frame, and the most that its motor gives."""

    joint: str
    torque: Float[np.ndarray, "T"]
    limit: float

    __repr__ = brief

    @property
    def load(self) -> Float[np.ndarray, "T"]:
        """The torque as a share of the limit."""
        return np.abs(self.torque) / self.limit


def joint_torques(
    body: ModelTrajectory,
    frame_time: float,
    window: float,
    points: Float[np.ndarray, "T P 3"],
    carriers: Int[np.ndarray, "P"],
    touching: Bool[np.ndarray, "T P"],
    friction: float,
    length: float,
) -> tuple[JointTorque, ...]:
    """The torques of the hinges whose file tells a limit; none where it tells none.

    `points` [m, world] may touch the floor, on the model's bodies `carriers`, where `touching`. A
    torque of 1 body weight x `length` [m] at the root counts as much as a force of 1 body weight.
    """
    model = _without_contacts(body.model)
    limits = {
        j: limit
        for j in hinges_and_balls(model, body.root)
        if int(model.jnt_type[j]) == HINGE
        and (limit := torque_limit(model, j)) is not None
        and limit > 0
    }
    if not limits or len(body.qpos) < 2:
        return ()
    velocity, acceleration = (
        rates(model, body.qpos, frame_time, order, window) for order in (1, 2)
    )
    dofs = {j: int(model.jnt_dofadr[j]) for j in limits}
    weight = float(model.body_subtreemass[body.root]) * GRAVITY
    rows, scale = _weighted_rows(model, body.root, dofs, limits, weight, length)
    data, out = mujoco.MjData(model), np.zeros((len(body.qpos), len(limits)))
    edges, columns = friction_edges(friction), list(dofs.values())
    jacobian = np.zeros((3, model.nv))
    for t, qpos in enumerate(body.qpos):
        data.qpos[:], data.qvel[:], data.qacc[:] = qpos, velocity[t], acceleration[t]
        mujoco.mj_inverse(model, data)
        needed = data.qfrc_inverse.copy()
        touched = np.flatnonzero(touching[t])
        if len(touched):
            gives = np.empty((model.nv, len(touched), edges.shape[1]))
            for k, p in enumerate(touched.tolist()):
                mujoco.mj_jac(model, data, jacobian, None, points[t, p], int(carriers[p]))
                gives[:, k] = jacobian.T @ edges
            gives = weight * gives.reshape(model.nv, -1)
            A = gives[rows] * scale[:, None]
            forces, _ = nnls(A, needed[rows] * scale, maxiter=50 * A.shape[1])
            needed = needed - gives @ forces
        out[t] = needed[columns]
    return tuple(
        JointTorque(joint_name(model, j), out[:, k], limits[j]) for k, j in enumerate(limits)
    )


@lru_cache(maxsize=4)  # a model with meshes has tens of megabytes, and many motions
def _without_contacts(model: mujoco.MjModel) -> mujoco.MjModel:
    """A copy of the model, of which inverse dynamics asks what nothing gives."""
    free = copy.copy(model)
    free.opt.gravity = [0.0, 0.0, -GRAVITY]
    free.opt.disableflags = int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    return free


def rates(
    model: mujoco.MjModel,
    qpos: Float[np.ndarray, "T nq"],
    frame_time: float,
    order: int,
    window: float,
) -> Float[np.ndarray, "T nv"]:
    """MuJoCo's `qvel` (order 1) or `qacc` (order 2) of each frame, measured over `window` seconds
    before and after it."""
    measured = derivative(qpos, frame_time, order, window)
    out = np.zeros((len(qpos), model.nv))
    for j in range(model.njnt):
        kind, q, v = int(model.jnt_type[j]), int(model.jnt_qposadr[j]), int(model.jnt_dofadr[j])
        if kind == FREE:
            out[:, v : v + 3] = measured[:, q : q + 3]
            out[:, v + 3 : v + 6] = _turning(qpos[:, q + 3 : q + 7], frame_time, order, window)
        elif kind == BALL:
            out[:, v : v + 3] = _turning(qpos[:, q : q + 4], frame_time, order, window)
        else:
            out[:, v] = measured[:, q]
    return out


def _turning(
    quat: Float[np.ndarray, "T 4"], frame_time: float, order: int, window: float
) -> Float[np.ndarray, "T 3"]:
    """Angular velocity [rad/s] or acceleration [rad/s²] in the turning body's own axes.

    The velocity is twice the vector part of conj(q) dq/dt; in its derivative conj(dq/dt) dq/dt has
    no vector part, so that the second derivative of q stands in for the first.
    """
    q = quat_continuous(quat)
    return 2 * quat_mul(quat_conj(q), derivative(q, frame_time, order, window))[..., 1:]


def _weighted_rows(
    model: mujoco.MjModel,
    root: int,
    dofs: dict[int, int],
    limits: dict[int, float],
    weight: float,
    length: float,
) -> tuple[Int[np.ndarray, "R"], Float[np.ndarray, "R"]]:
    """The rows of the least squares, and what each counts: the root's six where it is free, then
    the hinges'."""
    rows, scale = [*dofs.values()], [_SPARING / limit for limit in limits.values()]
    joint = int(model.body_jntadr[root])
    if joint >= 0 and int(model.jnt_type[joint]) == FREE:
        start = int(model.jnt_dofadr[joint])
        rows = [*range(start, start + 6), *rows]
        scale = [*[1 / weight] * 3, *[1 / (weight * length)] * 3, *scale]
    return np.array(rows), np.array(scale)
