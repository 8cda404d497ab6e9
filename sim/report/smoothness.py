"""Joint speed and jerk, per second and not per frame."""

import numpy as np
from jaxtyping import Float

from sim.report.derivatives import derivative
from spark.rig.rig import Rig
from spark.rotation import quat_conj, quat_continuous, quat_mul, quat_relative


def joint_rates(
    world: Float[np.ndarray, "T J 4"], rig: Rig, frame_time: float, window: float
) -> tuple[tuple[str, ...], Float[np.ndarray, "T B"], Float[np.ndarray, "T B"]]:
    """Names, angular speeds [rad/s] and jerks [rad/s³] of the joints with a role.

    A joint turns against the next joint above it that has a role, so that helpers between them do
    not matter; the topmost is left out. The jerk is the second derivative of the angular velocity.
    """
    roles, skeleton = rig.roles.roles, rig.skeleton
    joint_parents = [
        (j, above)
        for j, role in enumerate(roles)
        if role is not None
        and (above := next((k for k in skeleton.ancestors(j)[1:] if roles[k]), None)) is not None
    ]
    names = tuple(str(roles[j]).replace("_", " ") for j, _ in joint_parents)
    joints, parents = [j for j, _ in joint_parents], [above for _, above in joint_parents]
    rotations = quat_relative(world[:, parents], world[:, joints])
    return names, *angular_rates(rotations, frame_time, window)


def angular_rates(
    rotations: Float[np.ndarray, "T B 4"], frame_time: float, window: float
) -> tuple[Float[np.ndarray, "T B"], Float[np.ndarray, "T B"]]:
    """The angular speed [rad/s] of rotations over time, and the size of the angular velocity's
    second derivative [rad/s³]."""
    q = quat_continuous(rotations)
    omega = 2 * quat_mul(derivative(q, frame_time, 1, window), quat_conj(q))[..., 1:]
    jerk = derivative(omega, frame_time, 2, window)
    return np.linalg.norm(omega, axis=-1), np.linalg.norm(jerk, axis=-1)
