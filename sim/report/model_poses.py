"""Where the bodies of a model are in every frame, and how deep its shapes are in each other."""

import copy
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float, Int

from sim.trajectory import ModelTrajectory


@dataclass(frozen=True, eq=False)
class ModelPoses:
    """Bodies over time: `pos` [m] and `quat` in the world, by the model's number; `bodies` are the
    numbers of the humanoid's own.

    `pairs` are the names of parts whose shapes are in each other in some frame, `depth` [m] by how
    much; pairs that touch in the T-pose are left out.
    """

    bodies: Int[np.ndarray, "B"]
    pos: Float[np.ndarray, "T N 3"]
    quat: Float[np.ndarray, "T N 4"]
    pairs: tuple[tuple[str, str], ...]
    depth: Float[np.ndarray, "T K"]


def pose_model(body: ModelTrajectory) -> ModelPoses:
    """Run MuJoCo's kinematics and collision detection over all frames.

    Shapes collide as the file says: by its bits, excludes and pairs, never with their parents.
    """
    model = body.model
    if model.opt.disableflags:  # a file may switch contacts off for its simulation
        model = copy.copy(model)
        model.opt.disableflags = 0
    data = mujoco.MjData(model)
    bodies = np.flatnonzero(model.body_rootid == body.root)
    ignored = set() if body.tpose is None else set(_self_contacts(model, data, body.tpose, bodies))
    pos = np.empty((len(body.qpos), model.nbody, 3))
    quat = np.empty((len(body.qpos), model.nbody, 4))
    touching = []
    for t, qpos in enumerate(body.qpos):
        touching.append(_self_contacts(model, data, qpos, bodies))
        pos[t], quat[t] = data.xpos, data.xquat
    pairs = [*dict.fromkeys(p for contacts in touching for p in contacts if p not in ignored)]
    depth = np.array([[contacts.get(p, 0.0) for p in pairs] for contacts in touching])
    return ModelPoses(bodies, pos, quat, tuple(pairs), depth.reshape(len(touching), len(pairs)))


def part_name(model: mujoco.MjModel, body: int) -> str:
    """What a body is called, or the one that it is welded to."""
    part = int(model.body_weldid[body])
    return model.body(part).name.replace("_", " ") or f"body {part}"


def _self_contacts(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    qpos: Float[np.ndarray, "nq"],
    bodies: Int[np.ndarray, "B"],
) -> dict[tuple[str, str], float]:
    """How deep the humanoid's parts are in each other [m] in one pose."""
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_collision(model, data)
    contacts: dict[tuple[str, str], float] = {}
    if not data.ncon:
        return contacts
    touching = model.geom_bodyid[data.contact.geom]
    for (a, b), distance in zip(touching, data.contact.dist, strict=True):
        if distance < 0 and a in bodies and b in bodies:
            one, other = sorted((part_name(model, int(a)), part_name(model, int(b))))
            contacts[one, other] = max(contacts.get((one, other), 0.0), -float(distance))
    return contacts
