"""The npz that scripts with MuJoCo write: `qpos` and a rate, nothing else said.

`qpos` (T, nq) is MuJoCo's own: position [m], quaternion wxyz, joints [rad]. The rate is `fps`, or
the seconds between frames: `frame_time` or `dt`.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from robots.formats.arrays import number_array, scalar
from robots.formats.qpos import check_one_rate, frame_time_of, of_qpos
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from spark.errors import FileFormatError

_STEPS = ("frame_time", "dt")


def is_plain(arrays: Mapping[str, Any]) -> bool:
    """Whether an npz holds MuJoCo's coordinates."""
    return "qpos" in arrays


def read_plain(arrays: Mapping[str, Any], path: Path, robot: Morphology) -> RobotMotion:
    """The motion on `robot`. Raises `FileFormatError` where its columns are not the robot's, or the
    file has no rate."""
    qpos = number_array(arrays, "qpos", path, (None, None))
    expected = robot.mjcf.model.nq
    if qpos.shape[1] != expected:
        raise FileFormatError(
            path,
            None,
            f"'qpos' has {qpos.shape[1]} columns; the robot {robot.mjcf.path.stem!r} has {expected}"
            ". Is it of another robot, or are there objects beside it?",
        )
    notes = ("qpos is read as MuJoCo's: metres, quaternion wxyz, radians",)
    frame_time = _frame_time(arrays, path)
    check_one_rate(arrays, frame_time, path)
    return of_qpos(qpos, robot, frame_time, path, notes)


def _frame_time(arrays: Mapping[str, Any], path: Path) -> float:
    if "fps" in arrays:
        return frame_time_of(scalar(arrays, "fps", path), path)
    step = next((name for name in _STEPS if name in arrays), None)
    if step is None:
        raise FileFormatError(
            path, None, "doesn't say its rate; expected 'fps', 'frame_time' or 'dt' beside 'qpos'"
        )
    seconds = scalar(arrays, step, path)
    return frame_time_of(1 / seconds if seconds else np.inf, path)
