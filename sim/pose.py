"""Motions as MuJoCo coordinates: the free joint's pose and one quaternion a ball joint."""

import mujoco
import numpy as np
from jaxtyping import Float

from spark.kinematics import forward, local_rotations, world_positions
from spark.motion import Motion
from spark.rig import Rig
from spark.roles import Role
from spark.rotation import quat_about, quat_conj, quat_mul

_ARMS_DOWN = np.radians(75)


def qpos_from_motion(model: mujoco.MjModel, motion: Motion, rig: Rig) -> Float[np.ndarray, "T nq"]:
    """Coordinates of every frame on the body that `sim.body.build_body` made of `rig`.

    Bones that the file stretches keep the skeleton's length.
    """
    positions, world = forward(motion)
    return _assemble(model, rig, positions[:, rig.carrier], world)


def qpos_of_pose(
    model: mujoco.MjModel, rig: Rig, world: Float[np.ndarray, "J 4"]
) -> Float[np.ndarray, "nq"]:
    """The coordinates in which the joints have these rotations `q_world_joint` and the soles stand
    at z = 0, if the legs are those of the T-pose."""
    return _assemble(model, rig, standing_position(rig, world)[None], world[None])[0]


def standing_position(rig: Rig, world: Float[np.ndarray, "J 4"]) -> Float[np.ndarray, "3"]:
    """Where the carrier is [m] when the hips stand above the origin at the rig's hip height."""
    positions = world_positions(rig.skeleton, world, np.zeros(3))
    return positions[rig.carrier] - positions[rig.hips].mean(0) + np.array([0, 0, rig.hip_height])


def arms_down(rig: Rig) -> Float[np.ndarray, "J 4"]:
    """The T-pose with the arms lowered to the sides."""
    world = rig.tpose.copy()
    for role, angle in ((Role.LEFT_UPPER_ARM, -_ARMS_DOWN), (Role.RIGHT_UPPER_ARM, _ARMS_DOWN)):
        for j in rig.roles.joints(role)[:1]:
            arm = list(rig.skeleton.subtree(j))
            world[arm] = quat_mul(quat_about("x", np.array(angle)), world[arm])
    return world


def _assemble(
    model: mujoco.MjModel,
    rig: Rig,
    position: Float[np.ndarray, "T 3"],
    world: Float[np.ndarray, "T J 4"],
) -> Float[np.ndarray, "T nq"]:
    since_tpose = quat_mul(world, quat_conj(rig.tpose))
    local = local_rotations(rig.skeleton, since_tpose)
    qpos = np.empty((len(position), model.nq))
    for j in rig.skeleton.subtree(rig.carrier):
        address = int(model.joint(rig.skeleton.names[j]).qposadr[0])
        if j == rig.carrier:
            qpos[:, address : address + 3] = position
            qpos[:, address + 3 : address + 7] = since_tpose[:, j]
        else:
            qpos[:, address : address + 4] = local[:, j]
    return qpos
