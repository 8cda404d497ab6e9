"""Where the bodies of a model are in every frame, and how deep its shapes are in each other."""

from collections.abc import Mapping
from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float, Int

from sim.self_contact import colliding, self_contacts
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
    """Run MuJoCo's kinematics and collision detection over all frames."""
    model = colliding(body.model)
    data = mujoco.MjData(model)
    bodies = np.flatnonzero(model.body_rootid == body.root)
    own = {*bodies.tolist()}

    def contacts_in(qpos: Float[np.ndarray, "nq"]) -> dict[tuple[str, str], float]:
        return _by_parts(model, self_contacts(model, data, qpos, own))

    ignored = {} if body.tpose is None else contacts_in(body.tpose)
    pos = np.empty((len(body.qpos), model.nbody, 3))
    quat = np.empty((len(body.qpos), model.nbody, 4))
    touching = []
    for t, qpos in enumerate(body.qpos):
        touching.append(contacts_in(qpos))
        pos[t], quat[t] = data.xpos, data.xquat
    pairs = [*dict.fromkeys(p for contacts in touching for p in contacts if p not in ignored)]
    depth = np.array([[contacts.get(p, 0.0) for p in pairs] for contacts in touching])
    return ModelPoses(bodies, pos, quat, tuple(pairs), depth.reshape(len(touching), len(pairs)))


def part_name(model: mujoco.MjModel, body: int) -> str:
    """What a body is called, or the one that it is welded to."""
    part = int(model.body_weldid[body])
    return model.body(part).name.replace("_", " ") or f"body {part}"


def _by_parts(
    model: mujoco.MjModel, depths: Mapping[tuple[int, int], float]
) -> dict[tuple[str, str], float]:
    """By the names of the parts that bodies belong to."""
    named: dict[tuple[str, str], float] = {}
    for pair, depth in depths.items():
        one, other = sorted(part_name(model, body) for body in pair)
        named[one, other] = max(named.get((one, other), 0.0), depth)
    return named
