"""CSV as Unitree's LAFAN1 release has it: a row a frame, without a header; position [m],
quaternion, then the joints [rad] in the order of the MJCF. Unitree writes quaternions as xyzw,
others write wxyz, and the file does not say which; nor does it say its frame rate.
"""

import io
from pathlib import Path

import numpy as np
from jaxtyping import Float

from robots.formats.qpos import Columns, columns_of, frame_time_of, motion_of
from robots.model.morphology import Morphology
from robots.model.motion import RobotMotion
from spark.errors import ConventionError, FileFormatError
from spark.files import write_atomically

ORDERS = ("xyzw", "wxyz")
_BASE = 7
_UPRIGHT = 0.5  # cosine of the mean tilt of a trunk that mostly stands
_CLEARLY = 0.3  # how much less it is where quaternions are read in the wrong order


def write_csv(motion: RobotMotion, path: Path, *, quat: str = "xyzw") -> None:
    """Write a row a frame, with 9 decimals."""
    columns = columns_of(motion, path)
    turned = columns.quat if quat == "wxyz" else np.roll(columns.quat, -1, axis=1)
    out = io.StringIO()
    table = np.concatenate([columns.pos, turned, columns.angles], axis=1)
    np.savetxt(out, table, fmt="%.9f", delimiter=",")
    write_atomically(path, out.getvalue().encode())


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
    columns = Columns(table[:, :3], turned, table[:, _BASE:], frame_time_of(fps, path))
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
    turned = table[:, 3:_BASE]
    return turned if quat == "wxyz" else np.roll(turned, 1, axis=1)


def _table(path: Path) -> Float[np.ndarray, "T C"]:
    try:
        text = path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise FileFormatError(path, None, "is no text; expected rows of numbers") from error
    except OSError as error:
        raise FileFormatError(path, None, f"can't be read ({error.strerror})") from error
    if not text.strip():
        raise FileFormatError(path, None, "is empty; expected a row of numbers for each frame")
    try:
        table = np.loadtxt(io.StringIO(text), delimiter=",", comments=None, ndmin=2)
    except ValueError as error:
        raise _fault(path, text) from error
    if table.shape[1] <= _BASE:
        raise FileFormatError(
            path, 1, f"has {table.shape[1]} columns; expected 7 of the base and one for each joint"
        )
    bad = np.argwhere(~np.isfinite(table))
    if len(bad):
        row, column = bad[0].tolist()
        lines = [n for n, line in enumerate(text.splitlines(), start=1) if line.strip()]
        raise FileFormatError(path, lines[row], f"column {column + 1} is {table[row, column]}")
    return table


def _fault(path: Path, text: str) -> FileFormatError:
    """The first row that is not as the others are."""
    width = 0
    for number, line in enumerate(text.splitlines(), start=1):
        if not line.strip():
            continue
        cells = line.split(",")
        for column, cell in enumerate(cells, start=1):
            try:
                float(cell)
            except ValueError:
                what = "expected numbers, and no header" if number == 1 else "expected a number"
                return FileFormatError(path, number, f"column {column} is {cell[:40]!r}; {what}")
        width = width or len(cells)
        if len(cells) != width:
            return FileFormatError(
                path, number, f"has {len(cells)} columns, the rows above have {width}"
            )
    return FileFormatError(path, None, "can't be read as rows of numbers")
