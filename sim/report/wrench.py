"""The root wrench: what the floor cannot explain of the forces that a motion needs.

The six root rows of inverse dynamics are Newton's and Euler's equations of the whole body: the
floor must give the force m (a + g) and, about the centre of mass, the torque dL/dt. It pushes at
the points near it, within friction cones; what remains, a hand from heaven would have to give.
"""

import numpy as np
from jaxtyping import Bool, Float
from scipy.optimize import nnls

from sim.report.derivatives import derivative
from sim.report.mass import Mass
from spark.constants import GRAVITY
from spark.rotation import matrix_from_quat, quat_conj, quat_continuous, quat_mul

_EDGES = 8  # of the pyramid inside a friction cone: it gives 8 % less at worst (1 - cos 22.5°)


def required_wrench(mass: Mass, frame_time: float, window: float) -> Float[np.ndarray, "T 6"]:
    """What the floor must give: force [body weights], torque about the centre of mass [body weights
    x 1 m]."""
    force = derivative(mass.com, frame_time, 2, window)
    force[:, 2] += GRAVITY
    momentum = angular_momentum(mass, frame_time)
    torque = derivative(momentum, frame_time, 1, window)
    return np.concatenate([force, torque], axis=1) / GRAVITY


def angular_momentum(mass: Mass, frame_time: float) -> Float[np.ndarray, "T 3"]:
    """About the centre of mass, for a body of unit mass [m²/s], world axes."""
    if len(mass.rotations) < 2:
        return np.zeros((len(mass.rotations), 3))
    arms = mass.coms - mass.com[:, None]
    orbital = np.cross(arms, np.gradient(arms, frame_time, axis=0))
    q = quat_continuous(mass.rotations)
    omega = 2 * quat_mul(np.gradient(q, frame_time, axis=0), quat_conj(q))[..., 1:]
    R = matrix_from_quat(mass.rotations)
    spin = np.einsum("tsij,sjk,tslk,tsl->tsi", R, mass.inertias, R, omega, optimize=True)
    return np.einsum("s,tsx->tx", mass.fractions, orbital + spin)


def unexplained_wrench(
    wrench: Float[np.ndarray, "T 6"],
    arms: Float[np.ndarray, "T P 3"],
    touching: Bool[np.ndarray, "T P"],
    friction: float,
    length: float,
) -> Float[np.ndarray, "T 2"]:
    """What remains of force [body weights] and torque [body weights x 1 m] (norms).

    `arms` [m] are the contact points seen from the centre of mass. The forces at the points that
    touch, in cones of `friction`, are those that leave the least sum of squares; in it a torque of
    1 body weight x `length` counts as much as a force of 1 body weight.
    """
    edges = friction_edges(friction)
    scale = np.array([1.0, 1.0, 1.0, length, length, length])
    wanted = wrench / scale
    residual = wanted.copy()
    for t in np.flatnonzero(touching.any(axis=1)):
        points = arms[t, touching[t]]
        columns = np.concatenate(
            [
                np.broadcast_to(edges, (len(points), 3, _EDGES)),
                _cross_matrix(points / length) @ edges,
            ],
            axis=1,
        )
        A = columns.transpose(1, 0, 2).reshape(6, -1)
        forces, _ = nnls(A, wanted[t], maxiter=50 * A.shape[1])
        residual[t] = wanted[t] - A @ forces
    return np.stack(
        [
            np.linalg.norm(residual[:, :3], axis=1),
            length * np.linalg.norm(residual[:, 3:], axis=1),
        ],
        axis=1,
    )


def friction_edges(friction: float) -> Float[np.ndarray, "3 E"]:
    """The edges of the pyramid inside a friction cone, each with a normal force of 1."""
    angle = 2 * np.pi * np.arange(_EDGES) / _EDGES
    return np.stack([friction * np.cos(angle), friction * np.sin(angle), np.ones(_EDGES)])


def _cross_matrix(v: Float[np.ndarray, "P 3"]) -> Float[np.ndarray, "P 3 3"]:
    matrix = np.zeros((len(v), 3, 3))
    matrix[:, [2, 0, 1], [1, 2, 0]] = v
    matrix[:, [1, 2, 0], [2, 0, 1]] = -v
    return matrix
