"""ProtoMotions' `.motion`: the states of all bodies and joints, as PyTorch saves a dict of tensors.

Bodies and joints are in the MJCF's order, quaternions xyzw, world axes. PyTorch is not needed.
"""

from pathlib import Path
from typing import Any

import numpy as np

from robots.formats.arrays import number_array, scalar
from robots.formats.bodies import body_states, foot_contacts, gradient
from robots.formats.qpos import Columns, columns_of, frame_time_of, motion_of, rate_of
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from spark.errors import FileFormatError
from spark.io.tensors import Tensor, read_tensors
from spark.io.torch_save import write_tensors
from spark.rig.feet import FEET
from spark.rotation import quat_relative


def write_protomotions(motion: RobotMotion, path: Path) -> None:
    """Write the entries of its RobotState, as float32; the feet's contacts are labels of bodies."""
    robot = motion.robot
    angles = columns_of(motion, path).angles
    bodies = robot.mjcf.bodies()
    states = body_states(motion, bodies)
    above = [bodies.index(int(robot.mjcf.model.body_parentid[body])) for body in bodies[1:]]
    local = states.quat.copy()
    local[:, 1:] = quat_relative(states.quat[:, above], states.quat[:, 1:])
    contacts = np.zeros(states.pos.shape[:2], dtype=bool)
    for side, standing in foot_contacts(motion).items():
        contacts[:, bodies.index(_foot_body(robot, side))] = standing
    arrays = {
        "rigid_body_pos": states.pos,
        "rigid_body_rot": np.roll(states.quat, -1, axis=-1),
        "rigid_body_vel": states.lin_vel,
        "rigid_body_ang_vel": states.ang_vel,
        "local_rigid_body_rot": np.roll(local, -1, axis=-1),
        "dof_pos": angles,
        "dof_vel": gradient(angles, motion.frame_time),
    }
    entries: dict[str, Any] = {name: values.astype(np.float32) for name, values in arrays.items()}
    entries["rigid_body_contacts"] = contacts
    entries["fps"] = rate_of(motion.frame_time)
    write_tensors(path, entries)


def read_protomotions(path: Path, robot: Morphology) -> RobotMotion:
    """The motion in `path`."""
    stored = read_tensors(path)
    if not isinstance(stored, dict):
        raise FileFormatError(path, None, f"holds a {type(stored).__name__}; expected a dict")
    entries = {k: v.array() if isinstance(v, Tensor) else v for k, v in stored.items()}
    pos = number_array(entries, "rigid_body_pos", path, (None, None, 3))
    quat = number_array(entries, "rigid_body_rot", path, (len(pos), pos.shape[1], 4))
    angles = number_array(entries, "dof_pos", path, (len(pos), None))
    if not pos.shape[1]:
        raise FileFormatError(path, None, "holds no bodies; the first is the root")
    frame_time = frame_time_of(scalar(entries, "fps", path), path)
    columns = Columns(pos[:, 0], np.roll(quat[:, 0], 1, axis=-1), angles, frame_time)
    return motion_of(columns, robot, path)


def _foot_body(robot: Morphology, side: str) -> int:
    """The body that carries the sole of a side."""
    role = next(foot for name, (foot, _) in FEET.items() if name == side)
    link = int(robot.links[robot.rig.roles.require(role)])
    return int(robot.mjcf.model.jnt_bodyid[robot.mj_joints[link]])
