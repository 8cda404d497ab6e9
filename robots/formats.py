"""A robot's motion as a file that says what it holds."""

import hashlib
import io
import json
from pathlib import Path

import numpy as np

from robots.motion import RobotMotion
from spark.files import write_atomically

SCHEMA = "spark-sim qpos 1"


def write_npz(motion: RobotMotion, path: str | Path) -> None:
    """Write MuJoCo's coordinates and what they mean; no pickle.

    `qpos` [T, nq] is position [m], quaternion wxyz, then joints [rad] in `joint_names`' order;
    `frame_time` [s] is the step; `model_sha256` is that of the MJCF file; `about` is JSON of the
    conventions and of what was assumed. Raises `OutputError` where `path` can't be written.
    """
    model = motion.robot.mjcf
    about = {
        "schema": SCHEMA,
        "model": Path(model.path).name,
        "quaternion": "wxyz",
        "length_unit": "m",
        "angle_unit": "rad",
        "up_axis": "z",
        "notes": motion.notes,
    }
    out = io.BytesIO()
    np.savez_compressed(
        out,
        qpos=motion.qpos,
        frame_time=np.array(motion.frame_time),
        joint_names=np.array(motion.robot.joint_names),
        model_sha256=np.array(hashlib.sha256(Path(model.path).read_bytes()).hexdigest()),
        about=np.array(json.dumps(about)),
    )
    write_atomically(Path(path), out.getvalue())
