"""HoloMotion's npz: joints in the URDF's order, depth first, and the poses of all moving bodies in
the world, quaternions xyzw; `metadata` is JSON with the rate.

Keys of the reference motion begin with `ref_`. Older files have them without, and `_vels`.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from robots.formats.arrays import number_array, write_arrays
from robots.formats.bodies import body_names, body_states, contact_array, gradient, moving_bodies
from robots.formats.qpos import Columns, check_finite, columns_of, frame_time_of, motion_of
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from spark.errors import FileFormatError
from spark.opening import parse_json


def write_holomotion(motion: RobotMotion, path: Path) -> None:
    """Write the reference motion as float32, and beside it names and the feet's contacts."""
    angles = columns_of(motion, path).angles
    bodies = moving_bodies(motion.robot)
    states = body_states(motion, bodies)
    metadata = {
        "motion_key": path.stem,
        "raw_motion_key": path.stem,
        "motion_fps": 1 / motion.frame_time,
        "num_frames": len(motion),
        "wallclock_len": (len(motion) - 1) * motion.frame_time,
        "num_dofs": angles.shape[1],
        "num_bodies": len(bodies),
        "clip_length": len(motion),
        "valid_prefix_len": len(motion),
        "joint_names": list(motion.robot.joint_names),
        "body_names": list(body_names(motion.robot, bodies)),
        "quaternion": "xyzw",
    }
    arrays = {
        "ref_dof_pos": angles,
        "ref_dof_vel": gradient(angles, motion.frame_time),
        "ref_global_translation": states.pos,
        "ref_global_rotation_quat": np.roll(states.quat, -1, axis=-1),
        "ref_global_velocity": states.lin_vel,
        "ref_global_angular_velocity": states.ang_vel,
    }
    floats = {name: values.astype(np.float32) for name, values in arrays.items()}
    said = {"metadata": np.array(json.dumps(metadata))}
    write_arrays(path, said | floats | contact_array(motion))


def is_holomotion(arrays: Mapping[str, Any]) -> bool:
    """Whether an npz holds a motion as HoloMotion has it."""
    return bool({"ref_global_translation", "global_translation"} & arrays.keys())


def read_holomotion(arrays: Mapping[str, Any], path: Path, robot: Morphology) -> RobotMotion:
    """The reference motion in the arrays of `path`."""
    prefix = "ref_" if "ref_dof_pos" in arrays else ""
    angles = number_array(arrays, f"{prefix}dof_pos", path, (None, None))
    pos = number_array(arrays, f"{prefix}global_translation", path, (len(angles), None, 3))
    quat = number_array(
        arrays, f"{prefix}global_rotation_quat", path, (len(angles), pos.shape[1], 4)
    )
    if not pos.shape[1]:
        raise FileFormatError(path, None, "holds no bodies; the first is the root")
    check_finite(path, translation=pos, rotation_quat=quat)
    try:
        metadata = parse_json(path, str(arrays["metadata"]), "'metadata'")
        fps = float(metadata["motion_fps"])
    except (KeyError, ValueError, TypeError) as error:
        raise FileFormatError(
            path, None, "doesn't say its rate; expected JSON with 'motion_fps' under 'metadata'"
        ) from error
    columns = Columns(pos[:, 0], np.roll(quat[:, 0], 1, axis=-1), angles, frame_time_of(fps, path))
    said = "joints are read in the URDF's order, depth first, quaternions as xyzw"
    return motion_of(columns, robot, path, (said,))
