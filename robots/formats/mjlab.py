"""The npz that BeyondMimic and mjlab train on: joints, and the poses of all bodies in the world.

Joints and bodies come in the model's order, which is depth first in MuJoCo (mjlab) and breadth
first in Isaac Lab (BeyondMimic), and files don't say which, nor do all agree on the quaternions'
order. The bodies' places settle it: only one reading puts the robot's where the file has them.
"""

import io
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from jaxtyping import Float, Int

from robots.formats.arrays import number_array, scalar
from robots.formats.qpos import Columns, check_finite, columns_of, frame_time_of, motion_of
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.tree import Tree
from spark.errors import FileFormatError
from spark.files import write_atomically
from spark.rotation import quat_conj, quat_mul, rotvec_from_quat

_SAME_PLACE = 0.02  # [m] within which a body of the file is the robot's
_TELLING = 1e-3  # [m] by which the right order has to be nearer
_LOOKS = 25  # frames in which that is looked at


def write_mjlab(motion: RobotMotion, path: Path) -> None:
    """Write `fps`, `joint_pos`, `joint_vel` and the bodies' `body_pos_w`, `body_quat_w` (wxyz),
    `body_lin_vel_w` (of the body's own origin) and `body_ang_vel_w`, in world axes, as float32.

    Bodies are those of the robot, without the world. Velocities are central differences.
    """
    columns = columns_of(motion, path)
    pos, quat = body_poses(motion.robot, motion.qpos)
    dt = motion.frame_time
    arrays: dict[str, Any] = {
        "joint_pos": columns.angles,
        "joint_vel": _gradient(columns.angles, dt),
        "body_pos_w": pos,
        "body_quat_w": quat,
        "body_lin_vel_w": _gradient(pos, dt),
        "body_ang_vel_w": _turning(quat, dt),
    }
    out = io.BytesIO()
    arrays = {name: values.astype(np.float32) for name, values in arrays.items()}
    np.savez(out, fps=np.array([1 / dt]), **arrays)
    write_atomically(path, out.getvalue())


def read_mjlab(arrays: Mapping[str, Any], path: Path, robot: Morphology) -> RobotMotion:
    """The motion in the arrays of `path`. Raises `FileFormatError` where its bodies are not the
    robot's."""
    angles = number_array(arrays, "joint_pos", path, (None, len(robot.joint_names)))
    frames = len(angles)
    pos = number_array(arrays, "body_pos_w", path, (frames, None, 3))
    quat = number_array(arrays, "body_quat_w", path, (frames, pos.shape[1], 4))
    if not pos.shape[1]:
        raise FileFormatError(path, None, "'body_pos_w' holds no bodies; the first is the root")
    check_finite(path, joint_pos=angles, body_pos_w=pos, body_quat_w=quat)
    frame_time = frame_time_of(scalar(arrays, "fps", path), path)
    columns = Columns(pos[:, 0], quat[:, 0], angles, frame_time)
    readings = {
        (order, convention): replace(columns, quat=np.roll(quat[:, 0], shift, 1), angles=read)
        for order, read in _orders(angles, robot.tree).items()
        for convention, shift in (("wxyz", 0), ("xyzw", 1))
    }
    off = {how: _distance(reading, pos, robot, path) for how, reading in readings.items()}
    best = min(off, key=lambda how: off[how])
    if off[best] > _SAME_PLACE:
        raise FileFormatError(
            path,
            None,
            f"its bodies are up to {100 * off[best]:.3g} cm from where the robot "
            f"{robot.mjcf.path.stem!r} has them, in any order of joints; is it of another robot?",
        )
    order, convention = best
    rival = next(how for how in off if how[0] != order and how[1] == convention)
    unclear = off[rival] < off[best] + _TELLING and not np.allclose(
        readings[rival].angles, readings[best].angles
    )
    why = "though the bodies' places don't show it" if unclear else "as the bodies' places show"
    said = f"joints are read in {order}-first order, quaternions as {convention}, {why}"
    return motion_of(readings[best], robot, path, (said,))


def body_poses(
    robot: Morphology, qpos: Float[np.ndarray, "T nq"]
) -> tuple[Float[np.ndarray, "T B 3"], Float[np.ndarray, "T B 4"]]:
    """Where the robot's bodies are [m], and how they are turned (wxyz), the root first."""
    model, bodies = robot.mjcf.model, robot.mjcf.bodies()
    data = mujoco.MjData(model)
    pos, quat = np.zeros((len(qpos), len(bodies), 3)), np.zeros((len(qpos), len(bodies), 4))
    for t, frame in enumerate(qpos):
        data.qpos[:] = frame
        mujoco.mj_kinematics(model, data)
        pos[t], quat[t] = data.xpos[bodies], data.xquat[bodies]
    return pos, quat


def breadth_first(tree: Tree) -> Int[np.ndarray, "N"]:
    """The joints level by level: entry k is the joint that comes k-th."""
    depth = [len(tree.chain(j)) for j in range(len(tree))]
    return np.argsort(depth, kind="stable")


def _orders(angles: Float[np.ndarray, "T N"], tree: Tree) -> dict[str, Float[np.ndarray, "T N"]]:
    """The angles by hinge, where the file has them in either order."""
    breadth = np.zeros_like(angles)
    breadth[:, breadth_first(tree)] = angles
    return {"depth": angles, "breadth": breadth}


def _distance(
    columns: Columns, pos: Float[np.ndarray, "T B 3"], robot: Morphology, path: Path
) -> float:
    """How far [m] bodies of the robot and of the file are apart at most: each of the fewer from the
    nearest of the others."""
    at = np.unique(np.linspace(0, len(pos) - 1, min(_LOOKS, len(pos))).round().astype(int))
    few = Columns(columns.pos[at], columns.quat[at], columns.angles[at], columns.frame_time)
    own, _ = body_poses(robot, motion_of(few, robot, path).qpos)
    apart = np.linalg.norm(own[:, :, None] - pos[at][:, None], axis=-1)
    return float(apart.min(2 if own.shape[1] <= pos.shape[1] else 1).max())


def _gradient(values: Float[np.ndarray, "T ..."], dt: float) -> Float[np.ndarray, "T ..."]:
    return np.gradient(values, dt, axis=0) if len(values) > 1 else np.zeros_like(values)


def _turning(quat: Float[np.ndarray, "T B 4"], dt: float) -> Float[np.ndarray, "T B 3"]:
    """Angular velocities in world axes [rad/s]."""
    out = np.zeros((*quat.shape[:2], 3))
    if len(quat) > 1:
        after = np.minimum(np.arange(len(quat)) + 1, len(quat) - 1)
        before = np.maximum(np.arange(len(quat)) - 1, 0)
        turn = rotvec_from_quat(quat_mul(quat[after], quat_conj(quat[before])))
        out = turn / (dt * (after - before))[:, None, None]
    return out
