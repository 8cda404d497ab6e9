"""Motions of robots that ask for all of a file's format."""

import numpy as np
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from robots.model.morphology import Morphology


def all_over(robot: Morphology, frames: int, seconds: float) -> Float[np.ndarray, "T nq"]:
    """A smooth motion all over the joints' ranges, the base turning over, MuJoCo's coordinates."""
    model = robot.mjcf.model
    t = np.linspace(0, seconds, frames)[:, None]
    low, high = model.jnt_range[1:].T
    phases = np.random.default_rng(3).uniform(0, 6, model.njnt - 1)
    qpos = np.zeros((frames, model.nq))
    qpos[:, :3] = [0.3, -0.1, 0.8] + t * [1.0, 0.5, -0.2]
    turn = Rotation.from_rotvec(t * [0.5, 0.8, 2.0]) * Rotation.from_euler("z", 0.4)
    qpos[:, 3:7] = turn.as_quat(scalar_first=True)
    qpos[:, 7:] = (low + high) / 2 + (high - low) / 2.1 * np.sin(1.2 * t + phases)
    return qpos
