"""Joint speed and jerk, per second and not per frame."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from sim.report.derivatives import derivative
from spark.rig.rig import Rig
from spark.rotation import quat_angle, quat_conj, quat_continuous, quat_mul, quat_relative


class Rates(NamedTuple):
    """Of joints, by name: angular speeds [rad/s], jerks [rad/s³] (the second derivative of the
    angular velocity), and how far each turns from the frame before [rad]."""

    names: tuple[str, ...]
    speed: Float[np.ndarray, "T B"]
    jerk: Float[np.ndarray, "T B"]
    turns: Float[np.ndarray, "T B"]


def bone_pairs(rig: Rig) -> list[tuple[str, int, int]]:
    """The joints with a role: what each is called, it, and the next joint above it that has a role,
    against which it turns, so that helpers between them do not matter. The topmost is left out."""
    roles, skeleton = rig.roles.roles, rig.skeleton
    return [
        (role.replace("_", " "), j, above)
        for j, role in enumerate(roles)
        if role is not None
        and (above := next((k for k in skeleton.ancestors(j)[1:] if roles[k]), None)) is not None
    ]


def joint_rates(
    world: Float[np.ndarray, "T J 4"], rig: Rig, frame_time: float, window: float
) -> Rates:
    """The rates of the joints of `bone_pairs`, from the joints' rotations."""
    pairs = bone_pairs(rig)
    rotations = quat_relative(
        world[:, [above for _, _, above in pairs]], world[:, [joint for _, joint, _ in pairs]]
    )
    speed, jerk = angular_rates(rotations, frame_time, window)
    return Rates(tuple(name for name, _, _ in pairs), speed, jerk, turns_between(rotations))


def turns_between(rotations: Float[np.ndarray, "T *n 4"]) -> Float[np.ndarray, "T *n"]:
    """How far each turns from the frame before [rad]; 0 in the first."""
    turns = quat_angle(rotations[:-1], rotations[1:])
    return np.concatenate([np.zeros_like(rotations[:1, ..., 0]), turns])


def angular_rates(
    rotations: Float[np.ndarray, "T B 4"], frame_time: float, window: float
) -> tuple[Float[np.ndarray, "T B"], Float[np.ndarray, "T B"]]:
    """The angular speed [rad/s] of rotations over time, and the size of the angular velocity's
    second derivative [rad/s³]."""
    q = quat_continuous(rotations)
    omega = 2 * quat_mul(derivative(q, frame_time, 1, window), quat_conj(q))[..., 1:]
    jerk = derivative(omega, frame_time, 2, window)
    return np.linalg.norm(omega, axis=-1), np.linalg.norm(jerk, axis=-1)
