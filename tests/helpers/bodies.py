"""MuJoCo models of rigs, as they are written, and what to do with them."""

from collections.abc import Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import mujoco
import numpy as np

from sim.body.build import build_body
from sim.body.joints import JointType
from sim.body.mjcf import write_mjcf
from spark.io.reading import read_motion
from spark.rig.rig import Rig, understand
from tests.helpers.humanoids import ONE_A_RIG

STANDING = (
    *ONE_A_RIG,
    "mesh2motion/kaiju_Idle.bvh",
    "zoo/m2m_bird.bvh",
    "mixamo/Kaya/rumba*.fbx",
    "mixamo/Warrok*/*.fbx",
)
"""Bodies of all sorts that the roles of a human fit."""


@cache
def rig_of(path: Path) -> Rig:
    """What is understood of a recording's body."""
    return understand(read_motion(path).motion)


@cache
def scene_of(rig: Rig, joints: JointType = "ball") -> mujoco.MjModel:
    """The body on its floor, from the files that a user gets. All tests share it: change none."""
    with TemporaryDirectory() as folder:
        _, scene = write_mjcf(build_body(rig, joints=joints), Path(folder) / "body.xml")
        return mujoco.MjModel.from_xml_path(str(scene))


def at_key(model: mujoco.MjModel, name: str) -> mujoco.MjData:
    """The start of a simulation from a keyframe."""
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key(name).id)
    mujoco.mj_forward(model, data)
    return data


def run(model: mujoco.MjModel, data: mujoco.MjData, seconds: float) -> Iterator[mujoco.MjData]:
    """The simulation, step by step; it ends with an error where MuJoCo warns."""
    while data.time < seconds:
        mujoco.mj_step(model, data)
        assert not any(warning.number for warning in data.warning)
        yield data


def joint_errors_deg(
    model: mujoco.MjModel, qpos: np.ndarray, target: np.ndarray
) -> dict[str, float]:
    """How far each joint that has a servo is from its target [deg]."""
    away = np.zeros(model.nv)
    mujoco.mj_differentiatePos(model, away, 1.0, target, qpos)
    errors = {}
    for j in {int(j) for j in model.actuator_trnid[:, 0]}:
        at = int(model.jnt_dofadr[j])
        dofs = 3 if model.jnt_type[j] == int(mujoco.mjtJoint.mjJNT_BALL) else 1
        errors[model.joint(j).name] = float(np.degrees(np.linalg.norm(away[at : at + dofs])))
    return errors
