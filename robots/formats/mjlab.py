"""The npz that mjlab and BeyondMimic train on: joints, and the poses of all bodies in the world.

Joints and bodies come in MuJoCo's order, depth first (mjlab), or level by level, as Isaac Lab
numbers them (BeyondMimic). Other tools' files don't say which, nor do all agree on the quaternions'
order. The bodies' places settle it: only one reading puts the robot's where the file has them.
"""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from robots.formats.arrays import number_array, scalar, write_arrays
from robots.formats.bodies import (
    body_names,
    body_poses,
    body_states,
    breadth_first,
    contact_array,
    gradient,
    isaac_bodies,
)
from robots.formats.qpos import Columns, check_finite, columns_of, frame_time_of, motion_of
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from spark.errors import FileFormatError

_SAME_PLACE = 0.02  # [m] within which a body of the file is the robot's
_TELLING = 1e-3  # [m] by which the right order has to be nearer
_LOOKS = 25  # frames in which that is looked at


def write_mjlab(motion: RobotMotion, path: Path) -> None:
    """Write `fps`, `joint_pos`, `joint_vel` and the bodies' `body_pos_w`, `body_quat_w` (wxyz),
    `body_lin_vel_w` (of the body's own origin) and `body_ang_vel_w`, in world axes, as float32; and
    beside them the names, which mjlab doesn't ask for, and the feet's contacts.

    Joints and bodies are in MuJoCo's order, all bodies of the robot, without the world.
    """
    order = np.arange(len(motion.robot.joint_names))
    _write(motion, path, "MuJoCo", order, motion.robot.mjcf.bodies(), of_mass=False)


def write_beyondmimic(motion: RobotMotion, path: Path) -> None:
    """Write the same for BeyondMimic, as Isaac Lab has it: joints and bodies level by level, bodies
    without those that are welded on, and as `body_lin_vel_w` the velocities of the centres of mass.
    """
    robot = motion.robot
    _write(motion, path, "Isaac Lab", breadth_first(robot.tree), isaac_bodies(robot), of_mass=True)


def _write(
    motion: RobotMotion,
    path: Path,
    order: str,
    joints: Int[np.ndarray, "N"],
    bodies: list[int],
    *,
    of_mass: bool,
) -> None:
    angles = columns_of(motion, path).angles[:, joints]
    states = body_states(motion, bodies, of_mass=of_mass)
    arrays = {
        "joint_pos": angles,
        "joint_vel": gradient(angles, motion.frame_time),
        "body_pos_w": states.pos,
        "body_quat_w": states.quat,
        "body_lin_vel_w": states.lin_vel,
        "body_ang_vel_w": states.ang_vel,
    }
    about = {
        "joint_names": np.array([motion.robot.joint_names[j] for j in joints]),
        "body_names": np.array(body_names(motion.robot, bodies)),
        "order": np.array(order),
        "quaternion": np.array("wxyz"),
        "body_lin_vel_of": np.array("centres of mass" if of_mass else "origins"),
    }
    floats = {name: values.astype(np.float32) for name, values in arrays.items()}
    fps = {"fps": np.array([1 / motion.frame_time])}
    write_arrays(path, fps | floats | contact_array(motion) | about)


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
        for order, read in _orders(angles, arrays.get("joint_names"), robot).items()
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
    unclear = any(
        off[rival] < off[best] + _TELLING
        and not np.allclose(readings[rival].angles, readings[best].angles)
        for rival in off
        if rival[0] != order and rival[1] == convention
    )
    why = "though the bodies' places don't show it" if unclear else "as the bodies' places show"
    said = f"joints are read {order}, quaternions as {convention}, {why}"
    return motion_of(readings[best], robot, path, (said,))


def _orders(
    angles: Float[np.ndarray, "T N"], names: np.ndarray | None, robot: Morphology
) -> dict[str, Float[np.ndarray, "T N"]]:
    """The angles by hinge, in each order that the file may have them in."""
    if names is not None and sorted(names.tolist()) == sorted(robot.joint_names):
        return {"by their names": angles[:, [names.tolist().index(n) for n in robot.joint_names]]}
    breadth = np.zeros_like(angles)
    breadth[:, breadth_first(robot.tree)] = angles
    return {"in depth-first order": angles, "in breadth-first order": breadth}


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
