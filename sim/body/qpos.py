"""Motions as MuJoCo coordinates: the free joint's pose, quaternions of balls, angles of hinges."""

import mujoco
import numpy as np
from jaxtyping import Float

from sim.body.hinge_fit import fit_hinges
from sim.body.keyframes import standing_position
from sim.body.parts import kept_joints
from spark.kinematics import forward, local_rotations, world_positions
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.rotation import quat_conj, quat_mul


def qpos_from_motion(model: mujoco.MjModel, motion: Motion, rig: Rig) -> Float[np.ndarray, "T nq"]:
    """Coordinates of every frame on the body that `sim.body.build.build_body` made of `rig`.

    Bones that the file stretches keep the skeleton's length. Angles of hinges are continuous and
    within their ranges; `sim.body.hinge_fit.fit_hinges` also says what they lost.
    """
    return _assemble(model, rig, *forward(motion), motion.frame_time)


def qpos_of_pose(
    model: mujoco.MjModel, rig: Rig, world: Float[np.ndarray, "J 4"]
) -> Float[np.ndarray, "nq"]:
    """The coordinates in which the joints have these rotations `q_world_joint` and the soles stand
    at z = 0."""
    positions = world_positions(rig.skeleton, world, np.zeros(3))
    positions += standing_position(rig, world) - positions[rig.root_joint]
    return _assemble(model, rig, positions[None], world[None], 1.0)[0]


def _assemble(
    model: mujoco.MjModel,
    rig: Rig,
    positions: Float[np.ndarray, "T J 3"],
    world: Float[np.ndarray, "T J 4"],
    frame_time: float,
) -> Float[np.ndarray, "T nq"]:
    if np.any(model.jnt_type == int(mujoco.mjtJoint.mjJNT_HINGE)):
        return fit_hinges(model, rig, positions, world, frame_time).qpos
    since_tpose = quat_mul(world, quat_conj(rig.tpose))
    local = local_rotations(rig.skeleton, since_tpose)
    qpos = np.empty((len(positions), model.nq))
    for j in kept_joints(rig):
        address = int(model.joint(rig.skeleton.names[j]).qposadr[0])
        if j == rig.root_joint:
            qpos[:, address : address + 3] = positions[:, j]
            qpos[:, address + 3 : address + 7] = since_tpose[:, j]
        else:
            qpos[:, address : address + 4] = local[:, j]
    return qpos
