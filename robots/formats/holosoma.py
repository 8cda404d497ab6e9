"""The npz that holosoma trains on, as OmniRetarget's motions are kept: MuJoCo's coordinates under
the names of mjlab's arrays, and the poses of all bodies in the world."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from robots.formats.arrays import number_array, scalar, write_arrays
from robots.formats.bodies import body_names, body_states, contact_array
from robots.formats.qpos import (
    BASE_WIDTH,
    Columns,
    check_finite,
    columns_of,
    frame_time_of,
    motion_of,
)
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from sim.interpolate import velocities
from spark.errors import FileFormatError, name_list


def is_holosoma(arrays: Mapping[str, Any]) -> bool:
    """Whether `joint_pos` has the base before the joints that the file names."""
    if not {"joint_pos", "joint_names"} <= arrays.keys():
        return False
    shape = np.shape(arrays["joint_pos"])
    return len(shape) == 2 and shape[1] == BASE_WIDTH + np.size(arrays["joint_names"])


def write_holosoma(motion: RobotMotion, path: Path) -> None:
    """Write `joint_pos` (T, 7 + N), `joint_vel` (T, 6 + N; the base's linear velocity in world
    axes, its angular one in its own), all bodies' `body_pos_w`, `body_quat_w` (wxyz) and
    velocities in world axes, of their origins; `fps`, the names, and the feet's contacts."""
    robot, columns = motion.robot, columns_of(motion, path)
    model, bodies = robot.mjcf.model, robot.mjcf.bodies()
    states = body_states(motion, bodies)
    start = robot.mjcf.base_dof
    joints = model.jnt_dofadr[list(robot.mj_joints)]
    speeds = velocities(model, motion.qpos, motion.frame_time)
    arrays = {
        "joint_pos": np.column_stack([columns.pos, columns.quat, columns.angles]),
        "joint_vel": np.column_stack([speeds[:, start : start + 6], speeds[:, joints]]),
        "body_pos_w": states.pos,
        "body_quat_w": states.quat,
        "body_lin_vel_w": states.lin_vel,
        "body_ang_vel_w": states.ang_vel,
        "fps": np.array([1 / motion.frame_time]),
        "joint_names": np.array(robot.joint_names),
        "body_names": np.array(body_names(robot, bodies)),
    }
    write_arrays(path, arrays | contact_array(motion))


def read_holosoma(arrays: Mapping[str, Any], path: Path, robot: Morphology) -> RobotMotion:
    """The motion in the arrays of `path`; objects beside the robot are not read. Raises
    `FileFormatError` where the joints are not the robot's."""
    names = [str(name) for name in np.ravel(arrays["joint_names"])]
    if unknown := sorted(set(names) ^ set(robot.joint_names)):
        raise FileFormatError(
            path,
            None,
            f"its joints are not those of the robot {robot.mjcf.path.stem!r}, which differ in "
            f"{name_list(unknown)}",
        )
    qpos = number_array(arrays, "joint_pos", path, (None, BASE_WIDTH + len(names)))
    check_finite(path, joint_pos=qpos)
    order = [BASE_WIDTH + names.index(name) for name in robot.joint_names]
    frame_time = frame_time_of(scalar(arrays, "fps", path), path)
    columns = Columns(qpos[:, :3], qpos[:, 3:BASE_WIDTH], qpos[:, order], frame_time)
    said = "joint_pos is read as holosoma's: position [m], quaternion wxyz, joints by their names"
    objects = [name for name in arrays if name.startswith("object_")]
    left = (f"{name_list(objects)}: not read",) if objects else ()
    return motion_of(columns, robot, path, (said, *left))
