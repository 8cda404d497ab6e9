"""The pickle that GMR (General Motion Retargeting) writes, read without running what it may hold.

A dict: `fps`, `root_pos` [m], `root_rot` (xyzw), `dof_pos` [rad] in the order of the MJCF,
`local_body_pos` (bodies with the root at the origin, unturned) and `link_body_list`, their names.
"""

import pickle
from pathlib import Path

import numpy as np

from robots.formats.about import write_sidecar
from robots.formats.arrays import number_array, scalar
from robots.formats.bodies import body_poses
from robots.formats.made_from import Source
from robots.formats.qpos import Columns, columns_of, frame_time_of, motion_of, rate_of
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from spark.errors import FileFormatError
from spark.files import write_atomically
from spark.plain_pickle import read_plain_pickle

_PROTOCOL = 4  # the newest that stores arrays in a way that all of numpy's versions read


def write_pkl(motion: RobotMotion, path: Path, source: Source | None) -> None:
    """Write the six entries that GMR writes, bodies included, and beside it what they don't say."""
    columns = columns_of(motion, path)
    mjcf = motion.robot.mjcf
    still = motion.qpos.copy()
    base = mjcf.base_qpos
    still[:, base : base + 7] = [0.0, 0, 0, 1, 0, 0, 0]
    local, _ = body_poses(motion.robot, still)
    entries = {
        "fps": rate_of(motion.frame_time),
        "root_pos": columns.pos,
        "root_rot": np.roll(columns.quat, -1, axis=1),
        "dof_pos": columns.angles,
        "local_body_pos": local.astype(np.float32),
        "link_body_list": [mjcf.body_name(body) for body in mjcf.bodies()],
    }
    write_atomically(path, pickle.dumps(entries, protocol=_PROTOCOL))
    conventions = {"quaternion": "xyzw", "length_unit": "m", "angle_unit": "rad"}
    write_sidecar(
        motion, path, format="gmr", columns=[*entries], conventions=conventions, source=source
    )


def read_pkl(path: Path, robot: Morphology) -> RobotMotion:
    """The motion in `path`. Raises `FileFormatError` where the pickle holds anything but arrays."""
    entries = read_plain_pickle(path, expected="the motion of a robot")
    if not isinstance(entries, dict):
        raise FileFormatError(path, None, f"holds a {type(entries).__name__}; expected a dict")
    pos = number_array(entries, "root_pos", path, (None, 3))
    quat = number_array(entries, "root_rot", path, (len(pos), 4))
    angles = number_array(entries, "dof_pos", path, (len(pos), None))
    frame_time = frame_time_of(scalar(entries, "fps", path), path)
    return motion_of(Columns(pos, np.roll(quat, 1, axis=1), angles, frame_time), robot, path)
