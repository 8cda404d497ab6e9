"""What all files of a robot's motion hold: a base, its rotation, and the angles of the hinges."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float

from robots.formats.arrays import scalar
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from robots.registry import ENTRIES
from spark.errors import ConventionError, FileFormatError, OutputError
from spark.motion import check_frame_time

BASE_WIDTH = 7  # columns before the joints': position, quaternion
_HIGH = 10  # hip heights at which a robot hardly walks
_LARGEST = 1e8  # [m, rad] beyond, no difference between frames is left
_SAME_RATE = 1e-2  # of a rate: as those of files that round theirs
_NOTED, _REFUSED = 1e-3, 0.05  # how far the norm of a quaternion may be from 1


@dataclass(frozen=True, eq=False)
class Columns:
    """A motion as tables have it: `pos` [m, world], `quat` (wxyz) of the root's body, and `angles`
    [rad] of the hinges in the order of the MJCF; `frame_time` [s]."""

    pos: Float[np.ndarray, "T 3"]
    quat: Float[np.ndarray, "T 4"]
    angles: Float[np.ndarray, "T N"]
    frame_time: float


def columns_of(motion: RobotMotion, path: Path) -> Columns:
    """The motion as columns. Raises `OutputError` where the robot has ball joints."""
    robot = motion.robot
    if robot.tree.balls.any():
        raise OutputError(
            f"{path}: the robot has ball joints, and this format has hinges only; write our .npz"
        )
    base, qpos = robot.mjcf.base_qpos, motion.qpos
    return Columns(
        pos=qpos[:, base : base + 3],
        quat=qpos[:, base + 3 : base + 7],
        angles=qpos[:, robot.addresses],
        frame_time=motion.frame_time,
    )


def motion_of(
    columns: Columns, robot: Morphology, path: Path, notes: tuple[str, ...] = ()
) -> RobotMotion:
    """The motion on `robot`. Raises `FileFormatError` where a value is broken, or the columns are
    not this robot's."""
    joints = len(robot.joint_names)
    if columns.angles.shape[1] != joints:
        moves = columns.angles.shape[1]
        others = " or ".join(repr(entry.name) for entry in ENTRIES if entry.joints == moves)
        raise FileFormatError(
            path,
            None,
            f"moves {moves} joints; the robot {robot.mjcf.path.stem!r} has {joints}. Is it of "
            f"another robot{f', such as {others}' if others else ''}?",
        )
    check_finite(path, pos=columns.pos, quat=columns.quat, angles=columns.angles)
    base = robot.mjcf.base_qpos
    qpos = np.tile(robot.mjcf.model.qpos0, (len(columns.quat), 1))
    qpos[:, base : base + 3] = columns.pos
    qpos[:, base + 3 : base + 7] = columns.quat
    qpos[:, robot.addresses] = columns.angles
    return of_qpos(qpos, robot, columns.frame_time, path, notes)


def of_qpos(
    qpos: Float[np.ndarray, "T nq"],
    robot: Morphology,
    frame_time: float,
    path: Path,
    notes: tuple[str, ...],
) -> RobotMotion:
    """The motion of MuJoCo's coordinates, with what is remarkable about them as notes. Raises
    `FileFormatError` where a value is broken."""
    if not len(qpos):
        raise FileFormatError(path, None, "holds no frames")
    check_finite(path, qpos=qpos)
    rotation = slice(robot.mjcf.base_qpos + 3, robot.mjcf.base_qpos + 7)
    qpos[:, rotation], said = _unit(qpos[:, rotation], path)
    notes += said
    q = robot.from_qpos(qpos)
    over = np.maximum(robot.tree.lower - q.angles, q.angles - robot.tree.upper)
    over[:, robot.tree.balls] = 0.0
    if over.size and over.max() > np.radians(1):
        j = int(over.max(0).argmax())
        notes += (
            f"{robot.joint_names[j]!r} goes {np.degrees(over[:, j].max()):.0f} degrees beyond its "
            "limit",
        )
    height = float(np.median(q.pos[:, 2]))
    if height > _HIGH * robot.rig.hip_height:
        notes += (f"the base is {height:.3g} m high: positions are read as metres",)
    return RobotMotion(robot, q, frame_time, (*robot.notes, *notes))


def frame_time_of(fps: float, path: Path) -> float:
    """Seconds a frame. Raises `FileFormatError` where `fps` is no rate."""
    frame_time = 1.0 / fps if fps else np.inf
    try:
        check_frame_time(frame_time)
    except ConventionError as error:
        raise FileFormatError(path, None, f"fps is {fps:g}, {error}") from error
    return frame_time


def rate_of(frame_time: float) -> int | float:
    """Frames a second, as a whole number where they are one but for rounding."""
    fps = 1 / frame_time
    return round(fps) if abs(fps - round(fps)) < 1e-6 else fps


def check_one_rate(arrays: Mapping[str, object], frame_time: float, path: Path) -> None:
    """Raise `FileFormatError` where `fps`, `frame_time` or `dt` say another rate: one of them was
    changed, or stands for something else, and no one can tell which."""
    for name in ("fps", "frame_time", "dt"):
        if name in arrays:
            value = scalar(arrays, name, path)
            frames = (value if name == "fps" else 1 / value if value else np.inf) * frame_time
            if not abs(frames - 1) < _SAME_RATE:
                raise FileFormatError(
                    path,
                    None,
                    f"tells two rates: {name!r} is {value:g}, and another entry says "
                    f"{1 / frame_time:g} fps; leave the wrong one out",
                )


def check_finite(path: Path, **arrays: Float[np.ndarray, "T ..."]) -> None:
    """Raise `FileFormatError` at the first value that is no finite number, or too large to be a
    place or an angle."""
    for name, array in arrays.items():
        bad = np.argwhere(~(np.abs(array) < _LARGEST))
        if len(bad):
            frame, *place = bad[0].tolist()
            raise FileFormatError(
                path,
                None,
                f"{name}{place} is {array[tuple(bad[0])]} in frame {frame}; expected a number "
                f"below {_LARGEST:g}",
            )


def _unit(
    quat: Float[np.ndarray, "T 4"], path: Path
) -> tuple[Float[np.ndarray, "T 4"], tuple[str, ...]]:
    """The quaternions at length 1, and a note where they were not. Raises `FileFormatError` where
    they can't be rotations."""
    norm = np.linalg.norm(quat, axis=1)
    off = np.abs(norm - 1)
    worst = int(off.argmax()) if len(off) else 0
    if len(off) and off[worst] > _REFUSED:
        raise FileFormatError(
            path,
            None,
            f"the quaternion of frame {worst} has length {norm[worst]:.3g}; expected 1. Are "
            "columns missing, or in another order?",
        )
    notes: tuple[str, ...] = ()
    if len(off) and off[worst] > _NOTED:
        notes = (f"quaternions are up to {off[worst]:.2g} off unit length: normalised",)
    return quat / norm[:, None], notes
