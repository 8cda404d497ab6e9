"""CSV as the BONES-SEED data set has it: `Frame`, the root's place [cm] and its rotation about the
fixed axes x, then y, then z [degrees], and a column `<joint>_dof` [degrees] for each joint.

The header names the joints, and nothing says the rate: BONES-SEED's own files have 120 frames a
second.
"""

import io
from pathlib import Path

import numpy as np

from robots.formats.about import write_sidecar
from robots.formats.made_from import Source
from robots.formats.qpos import Columns, columns_of, frame_time_of, motion_of
from robots.formats.table import read_table
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from spark.errors import FileFormatError, name_list
from spark.files import write_atomically
from spark.io.euler import euler_over_time, quat_from_angles

_ROOT = tuple(f"root_{what}{axis}" for what in ("translate", "rotate") for axis in "XYZ")
_ENDING = "_dof"
_LONGEST = 1 << 16  # bytes of a header
_ORDER = "zyx"  # about fixed x, y, z is about moving z, y, x


def write_seed(motion: RobotMotion, path: Path, source: Source | None) -> None:
    """Write the header and a row a frame, with 6 decimals."""
    columns = columns_of(motion, path)
    turned = np.degrees(euler_over_time(columns.quat, _ORDER)[:, ::-1])
    frames = np.arange(len(motion))[:, None]
    table = np.hstack([frames, 100 * columns.pos, turned, np.degrees(columns.angles)])
    header = ["Frame", *_ROOT, *(f"{name}{_ENDING}" for name in motion.robot.joint_names)]
    out = io.StringIO()
    formats = ["%d", *["%.6f"] * (len(header) - 1)]
    np.savetxt(out, table, fmt=formats, delimiter=",", header=",".join(header), comments="")
    write_atomically(path, out.getvalue().encode())
    conventions = {"length_unit": "cm", "angle_unit": "degree", "rotation": "extrinsic xyz"}
    write_sidecar(
        motion, path, format="bones-seed", columns=header, conventions=conventions, source=source
    )


def is_seed(path: Path) -> bool:
    """Whether a CSV begins with such a header."""
    try:
        with path.open("rb") as file:  # a regular file: it was checked
            first = file.readline(_LONGEST).decode("utf-8-sig", errors="replace")
    except OSError:
        return False
    return _ROOT[0] in first.split(",")


def read_seed(path: Path, robot: Morphology, *, fps: float) -> RobotMotion:
    """The motion in `path`; joints are found by their names. Raises `FileFormatError` with the line
    of what is broken, or where a joint of the robot is missing."""
    header, table = read_table(path, header=True)
    assert header is not None
    wanted = [*_ROOT, *(f"{name}{_ENDING}" for name in robot.joint_names)]
    missing = [name for name in wanted if name not in header]
    if missing:
        raise FileFormatError(
            path,
            1,
            f"has no column {name_list(missing)}; is it of another robot than "
            f"{robot.mjcf.path.stem!r}?",
        )
    known = {"Frame", *wanted}
    left = [name for name in header if name not in known]
    notes = (f"columns that the robot has no joint for: {name_list(left)}",) if left else ()
    values = table[:, [header.index(name) for name in wanted]]
    quat = quat_from_angles(np.radians(values[:, 5:2:-1]), _ORDER)
    angles = np.radians(values[:, 6:])
    columns = Columns(values[:, :3] / 100, quat, angles, frame_time_of(fps, path))
    return motion_of(columns, robot, path, notes)
