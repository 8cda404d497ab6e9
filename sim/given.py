"""A motion on a MuJoCo model that exists already, where none is to be built from a rig."""

from dataclasses import dataclass

import mujoco
import numpy as np
from jaxtyping import Float


@dataclass(frozen=True, eq=False)
class GivenBody:
    """`spec` compiles to `model`; `root` is the humanoid's body with the free joint; `qpos` holds
    MuJoCo's coordinates of each frame (position [m], quaternion wxyz, joints [rad])."""

    spec: mujoco.MjSpec
    model: mujoco.MjModel
    root: int
    qpos: Float[np.ndarray, "T nq"]
