"""The parts of a robot's model that a policy's spec names."""

import mujoco
import numpy as np
from jaxtyping import Bool, Int

from sim.body.mj_joints import FREE, HINGE
from sim.physics.policy_spec import PolicySpec
from spark.errors import SkeletonError, name_list


def moving_bodies(model: mujoco.MjModel, root: int) -> Int[np.ndarray, "B"]:
    """The bodies of the robot that have a joint, without the root."""
    own: Bool[np.ndarray, N] = model.body_rootid == root
    moving = np.flatnonzero(own & (np.asarray(model.body_jntnum) > 0))
    return moving[moving != root]


def spec_joints(model: mujoco.MjModel, root: int, spec: PolicySpec) -> list[int]:
    """The spec's joints in the model, which must be all of the robot's."""
    free = int(model.body_jntadr[root])
    if free < 0 or int(model.jnt_type[free]) != FREE:
        raise SkeletonError("the robot's root has no free joint: a policy can't move it")
    own = {
        model.joint(j).name: j
        for j in range(model.njnt)
        if int(model.body_rootid[model.jnt_bodyid[j]]) == root and j != free
    }
    if unknown := [name for name in spec.joints if name not in own]:
        raise SkeletonError(
            f"{spec.path}: the robot has no joints {name_list(unknown)}; it has {name_list([*own])}"
        )
    hinges = [n for n in spec.joints if int(model.jnt_type[own[n]]) == HINGE]
    if other := [name for name in spec.joints if name not in hinges]:
        raise SkeletonError(f"{spec.path}: {name_list(other)} are no hinges")
    if left := [name for name in own if name not in spec.joints]:
        raise SkeletonError(
            f"{spec.path}: [joints] leaves out {name_list(left)} of the robot; a policy moves all "
            "joints of the model, so use a model without them"
        )
    return [own[name] for name in spec.joints]


def spec_bodies(model: mujoco.MjModel, spec: PolicySpec) -> list[int]:
    """The bodies in the model that the spec names."""
    own = {model.body(b).name: b for b in range(1, model.nbody)}
    if unknown := [name for name in spec.bodies if name not in own]:
        raise SkeletonError(
            f"{spec.path}: the robot has no bodies {name_list(unknown)}; it has {name_list([*own])}"
        )
    return [own[name] for name in spec.bodies]
