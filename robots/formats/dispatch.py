"""Reading and writing a robot's motion in any of the formats."""

from pathlib import Path

from robots.formats import QUATERNIONS, format_of
from robots.formats.gmr import read_pkl, write_pkl
from robots.formats.mjlab import read_mjlab, write_mjlab
from robots.formats.native import is_native, read_npz, write_npz
from robots.formats.plain import is_plain, read_plain
from robots.formats.unitree import ORDERS, likely_order, read_csv, write_csv
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from spark.errors import ConventionError, FileFormatError
from spark.npz import Npz
from spark.opening import check_regular


def write(
    motion: RobotMotion, path: Path, *, format: str | None = None, source: Path | None = None
) -> None:
    """Write a motion in `format`, or in the one that the ending says.

    Raises `OutputError` where the ending is not the format's.
    """
    match format_of(path, format):
        case "npz":
            write_npz(motion, path, source=source)
        case "mjlab":
            write_mjlab(motion, path)
        case "gmr":
            write_pkl(motion, path)
        case name:
            write_csv(motion, path, quat=QUATERNIONS[name])


def read(
    path: Path,
    robot: Morphology | None = None,
    *,
    quat: str | None = None,
    fps: float | None = None,
) -> RobotMotion:
    """The motion of a robot in a file of any of the formats; the content says which npz it is.

    Our npz knows its robot; `quat` and `fps` are for CSVs. Raises `ConventionError` where what the
    file doesn't say is not given, and `FileFormatError` where it is broken.
    """
    suffix = path.suffix.lower()
    check_regular(path, expected="the motion of a robot")
    if suffix == ".csv":
        _need(path, robot, quat, fps)
        assert robot is not None
        assert quat is not None
        assert fps is not None
        return read_csv(path, robot, quat=quat, fps=fps)
    arrays = Npz(path, expected="the motion of a robot") if suffix == ".npz" else None
    if arrays is not None and is_native(arrays):
        return read_npz(arrays, path, robot)
    if robot is None:
        raise ConventionError(f"{path}: doesn't say which robot moves; name it with --robot")
    if arrays is None:
        return read_pkl(path, robot)
    if not is_plain(arrays) and "joint_pos" not in arrays:
        held = ", ".join(map(repr, arrays)) or "nothing"
        raise FileFormatError(
            path, None, f"has neither MuJoCo's 'qpos' nor mjlab's 'joint_pos'; it holds {held}"
        )
    return read_plain(arrays, path, robot) if is_plain(arrays) else read_mjlab(arrays, path, robot)


def _need(path: Path, robot: Morphology | None, quat: str | None, fps: float | None) -> None:
    """A CSV says nothing of itself: all that is missing, in one message."""
    missing = []
    if robot is None:
        missing.append("the robot: --robot NAME")
    if quat is None:
        likely = likely_order(path)
        hint = f" (upright only as {likely})" if likely else ""
        missing.append(f"its quaternions' order: --quat {' or --quat '.join(ORDERS)}{hint}")
    if fps is None:
        missing.append("its frame rate: --fps N")
    if missing:
        raise ConventionError(f"{path}: a CSV doesn't say {'; '.join(missing)}")
