"""LocoMuJoCo's trajectory: `qpos` and `qvel` as MuJoCo has them, names of the joints, `frequency`
[Hz], and `split_points` between trajectories.

LocoMuJoCo refuses keys that it doesn't know, and calls the free joint of its robots `root`. It
computes the bodies' poses itself.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from robots.formats.arrays import number_array, scalar, write_arrays
from robots.formats.qpos import BASE_WIDTH, Columns, columns_of, frame_time_of, motion_of
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from sim.body.mj_joints import FREE, HINGE
from sim.interpolate import velocities
from spark.errors import FileFormatError, name_list

_FREE = "root"


def write_locomujoco(motion: RobotMotion, path: Path) -> None:
    """Write one trajectory of the root and the hinges."""
    columns = columns_of(motion, path)
    robot = motion.robot
    model = robot.mjcf.model
    dofs = [int(model.jnt_dofadr[joint]) for joint in robot.mj_joints]
    base = robot.mjcf.base_dof
    qvel = velocities(model, motion.qpos, motion.frame_time)
    arrays = {
        "qpos": np.hstack([columns.pos, columns.quat, columns.angles]),
        "qvel": qvel[:, [*range(base, base + 6), *dofs]],
        "split_points": np.array([0, len(motion)]),
        "joint_names": np.array([_FREE, *robot.joint_names]),
        "frequency": np.array(1 / motion.frame_time),
        "njnt": np.array(1 + len(dofs)),
        "jnt_type": np.array([FREE, *[HINGE] * len(dofs)]),
    }
    write_arrays(path, arrays)


def is_locomujoco(arrays: Mapping[str, Any]) -> bool:
    """Whether an npz holds LocoMuJoCo's trajectories."""
    return {"qpos", "split_points", "frequency"} <= arrays.keys()


def read_locomujoco(arrays: Mapping[str, Any], path: Path, robot: Morphology) -> RobotMotion:
    """The first trajectory, joints by their names; joints that the file leaves out stay at 0."""
    names = np.asarray(arrays.get("joint_names", [])).tolist()
    qpos = number_array(arrays, "qpos", path, (None, BASE_WIDTH - 1 + len(names)))
    own = [name for name in names[1:] if name in robot.joint_names]
    if not own or names[0] in robot.joint_names:
        raise FileFormatError(
            path,
            None,
            f"moves {name_list(names)}, of which the robot {robot.mjcf.path.stem!r} has "
            f"{len(own)}; expected a free joint and joints of the robot",
        )
    notes: tuple[str, ...] = ()
    left = [name for name in robot.joint_names if name not in own]
    if left:
        notes += (f"joints that are not in the file stay at 0: {name_list(left)}",)
    splits = number_array(arrays, "split_points", path, (None,)).astype(int)
    if len(splits) < 2 or not 0 <= splits[0] < splits[1] <= len(qpos):
        raise FileFormatError(path, None, f"'split_points' is {splits.tolist()}, no trajectory")
    if len(splits) > 2:
        notes += (f"the first of {len(splits) - 1} trajectories is read",)
    taken = qpos[splits[0] : splits[1]]
    angles = np.zeros((len(taken), len(robot.joint_names)))
    for name in own:
        angles[:, robot.joint_names.index(name)] = taken[:, BASE_WIDTH - 1 + names.index(name)]
    frame_time = frame_time_of(scalar(arrays, "frequency", path), path)
    return motion_of(
        Columns(taken[:, :3], taken[:, 3:BASE_WIDTH], angles, frame_time), robot, path, notes
    )
