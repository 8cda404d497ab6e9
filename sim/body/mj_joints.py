"""Joints of a MuJoCo model: their kinds as the model has them, and what they are called.

The kinds are numbers here: in MuJoCo 4 a model's number is not `in` a tuple of its enumeration.
"""

import mujoco
import numpy as np

FREE, BALL, SLIDE, HINGE = (
    int(getattr(mujoco.mjtJoint, f"mjJNT_{kind}")) for kind in ("FREE", "BALL", "SLIDE", "HINGE")
)


def hinges_and_balls(model: mujoco.MjModel, root: int) -> list[int]:
    """Those of a body of the world and of all that hang on it, in rising order."""
    own = model.body_rootid[model.jnt_bodyid] == root
    return np.flatnonzero(own & np.isin(model.jnt_type, (HINGE, BALL))).tolist()


def joint_name(model: mujoco.MjModel, joint: int) -> str:
    """The joint's name, or where it sits if it has none."""
    body = int(model.jnt_bodyid[joint])
    return model.joint(joint).name or f"joint {joint} of {body_name(model, body)}"


def body_name(model: mujoco.MjModel, body: int) -> str:
    """The body's name, or its number if it has none."""
    return model.body(body).name or f"body {body}"
