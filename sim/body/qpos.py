"""Motions and poses as MuJoCo coordinates: the free joint's pose, and balls' and hinges' own."""

import mujoco
import numpy as np
from jaxtyping import Float

from sim.body.hinges import angles_within
from sim.body.joints import mirrored
from sim.body.keyframes import standing_position
from sim.body.mj_joints import HINGE
from sim.body.parts import hinges_of, kept_joints, side_of
from spark.blocks import in_blocks
from spark.kinematics import forward, local_rotations
from spark.motion import Motion
from spark.rig.rig import Rig
from spark.rotation import quat_conj, quat_from_rotvec, quat_mul, quat_relative


def qpos_from_motion(model: mujoco.MjModel, motion: Motion, rig: Rig) -> Float[np.ndarray, "T nq"]:
    """Coordinates of every frame on the body with ball joints that `sim.body.build.build_body` made
    of `rig`. (`spark-sim retarget` puts a motion on one with hinges.)

    Bones that the file stretches keep the skeleton's length.
    """
    return in_blocks(lambda block: _coordinates(model, motion.picked(block), rig), len(motion))


def _coordinates(model: mujoco.MjModel, motion: Motion, rig: Rig) -> Float[np.ndarray, "T nq"]:
    positions, world = forward(motion)
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


def qpos_of_pose(
    model: mujoco.MjModel, rig: Rig, world: Float[np.ndarray, "J 4"]
) -> Float[np.ndarray, "nq"]:
    """The coordinates in which the joints have these rotations `q_world_joint`, hinges as near to
    them as their ranges allow, and the soles stand at z = 0."""
    since_tpose = quat_mul(world, quat_conj(rig.tpose))
    reached = since_tpose.copy()  # what a joint lacks, those below it make up for
    qpos = model.qpos0.copy()
    hinged = np.any(model.jnt_type == HINGE)
    root, *joints = kept_joints(rig)
    address = int(model.joint(rig.skeleton.names[root]).qposadr[0])
    qpos[address : address + 3] = standing_position(rig, world)
    qpos[address + 3 : address + 7] = since_tpose[root]
    for j in joints:
        parent = reached[int(rig.skeleton.parents[j])]
        local = quat_relative(parent, since_tpose[j])
        if not hinged:
            address = int(model.joint(rig.skeleton.names[j]).qposadr[0])
            qpos[address : address + 4] = local
            continue
        reached[j] = parent
        hinges, side = hinges_of(rig, j), side_of(rig, j)
        if not hinges:
            continue
        axes = np.array([mirrored(hinge.axis, side) for _, hinge in hinges])
        ranges = np.radians([hinge.range_deg for _, hinge in hinges])
        for (name, _), axis, angle in zip(
            hinges, axes, angles_within(local, axes, ranges), strict=True
        ):
            qpos[int(model.joint(name).qposadr[0])] = angle
            reached[j] = quat_mul(reached[j], quat_from_rotvec(angle * axis))
    return qpos
