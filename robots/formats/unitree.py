"""CSV as Unitree's LAFAN1 release has it: a row a frame, without a header; position [m],
quaternion, then the joints [rad] in the order of the MJCF. Unitree writes quaternions as xyzw,
others write wxyz, and the file does not say which; nor does it say its frame rate.
"""

import io
from pathlib import Path

import numpy as np
from jaxtyping import Float

from robots.formats.about import write_sidecar
from robots.formats.made_from import Source
from robots.formats.qpos import BASE_WIDTH, Columns, columns_of, frame_time_of, motion_of
from robots.formats.table import read_table
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from spark.errors import ConventionError, FileFormatError
from spark.files import write_atomically

ORDERS = ("xyzw", "wxyz")
_UPRIGHT = 0.5  # cosine of the mean tilt of a trunk that mostly stands
_CLEARLY = 0.3  # how much less it is where quaternions are read in the wrong order


def write_csv(motion: RobotMotion, path: Path, *, quat: str, source: Source | None = None) -> None:
    """Write a row a frame, with 9 decimals, and beside it what the rows don't say."""
    columns = columns_of(motion, path)
    turned = columns.quat if quat == "wxyz" else np.roll(columns.quat, -1, axis=1)
    out = io.StringIO()
    table = np.concatenate([columns.pos, turned, columns.angles], axis=1)
    np.savetxt(out, table, fmt="%.9f", delimiter=",")
    write_atomically(path, out.getvalue().encode())
    named = [*"xyz", *(f"q{axis}" for axis in quat), *motion.robot.joint_names]
    conventions = {"quaternion": quat, "length_unit": "m", "angle_unit": "rad"}
    format = "csv" if quat == "xyzw" else "csv-wxyz"
    write_sidecar(
        motion, path, format=format, columns=named, conventions=conventions, source=source
    )


def read_csv(path: Path, robot: Morphology, *, quat: str, fps: float) -> RobotMotion:
    """The motion in `path`. Raises `FileFormatError` with the line of what is broken."""
    if quat not in ORDERS:
        raise ConventionError(f"quaternion order {quat!r} is not known; expected xyzw or wxyz")
    table = _table(path)
    notes: tuple[str, ...] = ()
    likely = upright_order(table)
    if likely not in (quat, None):
        notes = (f"read as {quat} the robot does not stand upright, as {likely} it does",)
    turned = _wxyz(table, quat)
    columns = Columns(table[:, :3], turned, table[:, BASE_WIDTH:], frame_time_of(fps, path))
    return motion_of(columns, robot, path, notes)


def likely_order(path: Path) -> str | None:
    """What `upright_order` says of a file."""
    return upright_order(_table(path))


def upright_order(table: Float[np.ndarray, "T C"]) -> str | None:
    """The order in which the trunk mostly stands upright, where it does not in the other one."""
    upright = {order: uprightness(table, order) for order in ORDERS}
    best, other = sorted(ORDERS, key=lambda order: -upright[order])
    clear = upright[best] > _UPRIGHT and upright[best] - upright[other] > _CLEARLY
    return best if clear else None


def uprightness(table: Float[np.ndarray, "T C"], quat: str) -> float:
    """The mean cosine between the root's z axis and up."""
    _, x, y, _ = _wxyz(table, quat).T
    return float(np.mean(1 - 2 * (x**2 + y**2)))


def _wxyz(table: Float[np.ndarray, "T C"], quat: str) -> Float[np.ndarray, "T 4"]:
    turned = table[:, 3:BASE_WIDTH]
    return turned if quat == "wxyz" else np.roll(turned, 1, axis=1)


def _table(path: Path) -> Float[np.ndarray, "T C"]:
    _, table = read_table(path)
    if table.shape[1] <= BASE_WIDTH:
        raise FileFormatError(
            path, 1, f"has {table.shape[1]} columns; expected 7 of the base and one for each joint"
        )
    return table
