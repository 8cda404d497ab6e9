"""What a session records: each step at once, so that nothing is lost where it is killed."""

import json
import os
from pathlib import Path

import numpy as np
from jaxtyping import Float

from robots.model.motion import RobotMotion
from sim.interpolate import quaternions
from spark.errors import ConventionError, FileFormatError, OutputError
from spark.motion import check_frame_time
from spark.opening import read_bytes
from spark.resample import frames_of_keys, rotations_at, values_at
from spark_sim import files
from spark_sim.clips import RobotClip
from spark_sim.loading import load_robot

ENDING = ".part"
_SCHEMA = "spark-sim live 1"
_LONGEST_HEADER = 10_000  # bytes
_MOST_GAP = 600  # steps: a longer one is a pause, which is not filled
_MOST_FILLED = 10  # times the steps that were taken: with more, each gap is a pause
_LARGEST = 1e8  # [m, rad], as robots' motions are read

_NO_HEADER = (ValueError, OverflowError, KeyError, TypeError, RecursionError, ConventionError)


class Journal:
    """Writes steps to `PATH.part`: a line of JSON, then for each step its number and the robot's
    coordinates, 8 bytes each, little-endian. `close` makes the npz of it at `path`.

    Raises `OutputError` where `path` is not free, or a session that was killed left its part.
    """

    def __init__(self, path: Path, robot: RobotClip, name: str, frame_time: float) -> None:
        self.path, self._part = path, path.with_name(path.name + ENDING)
        if self._part.exists():
            raise OutputError(
                f"{self._part}: is left of a session that was killed; make a motion of it with "
                f"`spark-sim live --recover {self._part}`, or remove it"
            )
        self._width = len(robot.qpos[0])
        about = {"schema": _SCHEMA, "robot": name, "frame_time": frame_time, "nq": self._width}
        try:
            self._file = self._part.open("wb", buffering=0)
        except OSError as error:
            raise OutputError(f"{self._part}: can't be written ({error.strerror})") from error
        self._file.write(json.dumps(about).encode() + b"\n")
        self._robot = robot
        self.lost = ""
        """Why nothing more is written, where that is so."""

    def write(self, step: int, qpos: Float[np.ndarray, "nq"]) -> None:
        """Keep a step. A disk that is full must not stop the robot: `lost` says it then."""
        if self.lost:
            return
        try:
            self._file.write(np.int64(step).tobytes() + qpos.astype("<f8").tobytes())
        except OSError as error:
            self.lost = f"{self._part}: can't be written any more ({error.strerror})"

    def close(self) -> Path | None:
        """Make the npz; None where no step was taken."""
        self._file.close()
        written = _steps(self._part, self._part.read_bytes())
        if written is None:
            self._part.unlink()
            return None
        steps, qpos, about = written
        _save(self._robot, steps, qpos, float(about["frame_time"]), self.path)
        self._part.unlink()
        return self.path


def recover(part: Path, *, force: bool) -> Path:
    """Make the npz of what a killed session left. Raises `FileFormatError` where that is no such
    file, and `OutputError` where the npz is there already."""
    written = _steps(part, read_bytes(part, expected="what a live session recorded"))
    if written is None:
        raise FileFormatError(part, None, "holds no step; remove it")
    if not part.name.endswith(f".npz{ENDING}"):
        raise FileFormatError(part, None, f"expected a name that ends in .npz{ENDING}")
    path = part.with_suffix("")
    files.claim(path, force=force)
    steps, qpos, about = written
    robot = load_robot(about["robot"])
    if qpos.shape[1] != len(robot.qpos[0]):
        raise FileFormatError(
            part,
            None,
            f"has {qpos.shape[1]} coordinates a step; {about['robot']} has {len(robot.qpos[0])}",
        )
    _save(robot, steps, qpos, float(about["frame_time"]), path)
    os.unlink(part)
    return path


def _steps(
    path: Path, content: bytes
) -> tuple[Float[np.ndarray, "N"], Float[np.ndarray, "N nq"], dict[str, str]] | None:
    """The steps that are whole, and what is said of them; None where there are none."""
    head, newline, rows = content[:_LONGEST_HEADER].partition(b"\n")
    try:
        about = json.loads(head)
        if not newline or about["schema"] != _SCHEMA or not isinstance(about["robot"], str):
            raise ValueError
        check_frame_time(float(about["frame_time"]))
        width = int(about["nq"])
        if not 7 <= width <= 10_000:
            raise ValueError
    except _NO_HEADER as error:
        raise FileFormatError(path, None, "is nothing that `spark-sim live` began") from error
    rows = content[len(head) + 1 :]
    count = len(rows) // (8 * (width + 1))
    table = np.frombuffer(rows, "<f8", count * (width + 1)).reshape(count, width + 1)
    steps = np.frombuffer(rows, "<i8", count * (width + 1)).reshape(count, width + 1)[:, 0]
    later = steps > np.maximum.accumulate(np.r_[-1, steps])[:-1]
    whole = (np.abs(table[:, 1:]) <= _LARGEST).all(1) & later
    if not whole.any():
        return None
    return steps[whole].astype(float), table[whole, 1:], about


def _save(
    robot: RobotClip,
    steps: Float[np.ndarray, "N"],
    qpos: Float[np.ndarray, "N nq"],
    frame_time: float,
    path: Path,
) -> None:
    """Write the motion; steps that were left out are filled in between."""
    gaps = np.diff(steps, prepend=steps[0])
    filled = np.minimum(gaps, _MOST_GAP)
    if filled.sum() > _MOST_FILLED * len(gaps) + 10 * _MOST_GAP:
        filled = np.minimum(gaps, 1)
    steps = np.cumsum(filled)
    at = frames_of_keys(steps, np.arange(int(steps[-1]) + 1, dtype=float))
    body = robot.on_robot.robot
    columns = quaternions(body.mjcf.model)
    even = values_at(qpos, at)
    even[:, columns] = rotations_at(qpos[:, columns], at)
    motion = RobotMotion(body, body.from_qpos(even), frame_time)
    RobotClip(motion, path.stem).save(path, force=True)
