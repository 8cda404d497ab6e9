"""How deep parts of a body are in each other, as MuJoCo's collision detection has it."""

import copy
from collections.abc import Collection

import mujoco
import numpy as np
from jaxtyping import Float


def colliding(model: mujoco.MjModel) -> mujoco.MjModel:
    """The model, or one like it where its file switches contacts off for its simulation."""
    if not model.opt.disableflags:
        return model
    model = copy.copy(model)
    model.opt.disableflags = 0
    return model


def self_contacts(
    model: mujoco.MjModel,
    data: mujoco.MjData,
    qpos: Float[np.ndarray, "nq"],
    bodies: Collection[int],
) -> dict[tuple[int, int], float]:
    """How deep [m] which of the `bodies` are in each other in one pose, by their numbers, the lower
    one first. `data` is then in that pose.

    Shapes collide as the file says: by its bits, excludes and pairs, never with their parents.
    """
    data.qpos[:] = qpos
    mujoco.mj_kinematics(model, data)
    mujoco.mj_collision(model, data)
    depths: dict[tuple[int, int], float] = {}
    if not data.ncon:
        return depths
    touching = model.geom_bodyid[data.contact.geom].tolist()
    for pair, distance in zip(touching, data.contact.dist.tolist(), strict=True):
        first, second = sorted(pair)
        if distance < 0 and first in bodies and second in bodies:
            depths[first, second] = max(depths.get((first, second), 0.0), -distance)
    return depths


def may_touch_itself(model: mujoco.MjModel, root: int) -> bool:
    """Whether the file lets any two parts of a body touch, by their shapes' bits or as a pair."""
    own = model.body_rootid[model.geom_bodyid] == root
    parts = model.body_weldid[model.geom_bodyid[own]]
    bits = np.bitwise_and.outer(model.geom_contype[own], model.geom_conaffinity[own])
    paired = own[model.pair_geom1] & own[model.pair_geom2]
    return bool((bits[parts[:, None] != parts]).any() or paired.any())
