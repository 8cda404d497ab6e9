"""Mass, centre and inertia of each joint's body in the T-pose, in world axes."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from spark.constants import GRAVITY
from spark.kinematics import world_positions
from spark.rig.rig import Rig
from spark.rig.segments import segments
from spark.rotation import matrix_from_quat

MIN_MASS = 1e-3  # [kg] of fingers and helpers: MuJoCo refuses moving bodies without mass
_MIN_GYRATION = 0.01  # [m], radius of gyration of a body of `MIN_MASS`


@dataclass(frozen=True, eq=False)
class Inertias:
    """One rigid body a joint: `masses` [kg], `coms` [m] from the joint, `tensors` [kg m²] about
    them; both in T-pose world axes."""

    masses: Float[np.ndarray, "J"]
    coms: Float[np.ndarray, "J 3"]
    tensors: Float[np.ndarray, "J 3 3"]


def inertias(rig: Rig, total: float) -> Inertias:
    """How a human of `total` [kg] is spread over the joints of a rig; those that carry nothing of
    it get `MIN_MASS`."""
    pieces = segments(rig)
    count = len(rig.skeleton)
    R = matrix_from_quat(rig.tpose[pieces.joints])
    piece_coms = np.einsum("sik,sk->si", R, pieces.coms)
    masses, moments = np.zeros(count), np.zeros((count, 3))
    np.add.at(masses, pieces.joints, pieces.masses * total)
    np.add.at(moments, pieces.joints, (pieces.masses * total)[:, None] * piece_coms)
    light = masses < MIN_MASS
    masses[light], moments[light] = MIN_MASS, 0.0
    coms = moments / masses[:, None]

    away = piece_coms - coms[pieces.joints]
    spread = (away**2).sum(-1)[:, None, None] * np.eye(3) - away[:, :, None] * away[:, None]
    about_com = R @ pieces.inertias @ R.swapaxes(-1, -2) + spread
    tensors = np.zeros((count, 3, 3))
    np.add.at(tensors, pieces.joints, (pieces.masses * total)[:, None, None] * about_com)
    tensors[light] = 0.0
    tensors += MIN_MASS * _MIN_GYRATION**2 * np.eye(3)
    return Inertias(masses, coms, tensors)


def holding_torques(rig: Rig, bodies: Inertias) -> Float[np.ndarray, "J"]:
    """The torque [N m] with which gravity pulls at each joint of the T-pose when all that hangs on
    it is held out horizontally."""
    positions = world_positions(rig.skeleton, rig.tpose, np.zeros(3))
    masses = bodies.masses.copy()
    moments = bodies.masses[:, None] * (positions + bodies.coms)
    for j in reversed(range(1, len(masses))):
        parent = int(rig.skeleton.parents[j])
        masses[parent] += masses[j]
        moments[parent] += moments[j]
    return GRAVITY * np.linalg.norm(moments - masses[:, None] * positions, axis=1)
