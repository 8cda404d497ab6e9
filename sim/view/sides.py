"""Left and right of a robot, tinted apart, so that its front can be told from its back.

The colours are those of the bodies that are built for characters: orange is left, blue is right.
"""

from collections.abc import Sequence

import mujoco
import numpy as np
from jaxtyping import Float

from sim.trajectory import ModelTrajectory

LEFT, RIGHT = (0.85, 0.42, 0.28), (0.35, 0.55, 0.85)
_TINT = 0.45  # of the colour that is shown
_BESIDE = 0.03  # of the robot's extent: nearer to the middle is neither left nor right


def tints(body: ModelTrajectory, inside: Sequence[int]) -> dict[int, Float[np.ndarray, "3"]]:
    """The tint of each of the robot's bodies `inside` that is to the left or to the right of its
    root in the T-pose, which faces along X; none where the T-pose is not known."""
    if body.tpose is None:
        return {}
    model, data = body.model, mujoco.MjData(body.model)
    data.qpos[:] = body.tpose
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    beside = data.xipos[:, 1] - data.xpos[body.root, 1]
    least = _BESIDE * float(np.ptp(data.xipos[list(inside)], axis=0).max())
    sides = {b: LEFT if beside[b] > 0 else RIGHT for b in inside if abs(beside[b]) > least}
    return {b: np.array(rgb) for b, rgb in sides.items()}


def tinted(
    rgba: Float[np.ndarray, "4"], tint: Float[np.ndarray, "3"] | None
) -> Float[np.ndarray, "4"]:
    """The colour, more or less that of its side."""
    if tint is None:
        return rgba
    return np.append((1 - _TINT) * rgba[:3] + _TINT * tint, rgba[3])
