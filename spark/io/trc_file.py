"""The points in a TRC file: their names, places, rate and unit.

Motion Analysis' text, which OpenSim, OpenCap and Pose2Sim write: three lines of a head, a line of
names, a line of axes, and a row of tab-separated numbers a frame. A point that was not seen is an
empty field.
"""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from spark.errors import FileFormatError
from spark.io.c3d_file import C3dPoints
from spark.io.charset import to_utf8
from spark.io.scanner import LARGEST
from spark.opening import read_bytes

_HEAD = 5  # lines before the first row


def read_trc_points(path: Path) -> C3dPoints:
    """The points of the file. Raises `FileFormatError` with the line where it is no TRC, or its
    rows do not go with its names."""
    text = to_utf8(read_bytes(path, expected="a TRC file"))[0].decode("utf-8-sig")
    lines = text.splitlines()
    if len(lines) < _HEAD or not lines[0].startswith("PathFileType"):
        raise FileFormatError(path, 1, "is no TRC file: it does not begin with PathFileType")
    said = dict(zip(_fields(lines[1]), _fields(lines[2]), strict=False))
    names = [name for name in _fields(lines[3])[2:] if name]
    if not names:
        raise FileFormatError(path, 4, "names no points; expected Frame#, Time and their names")
    rows = [(i, line) for i, line in enumerate(lines[_HEAD:], start=_HEAD + 1) if line.strip()]
    if not rows:
        raise FileFormatError(path, None, f"has no frames of its {len(names)} points")
    values = np.array([_row(path, i, line, len(names)) for i, line in rows])
    counted = said.get("NumFrames", "")
    notes: tuple[str, ...] = ()
    if counted.isdecimal() and int(counted) != len(rows):
        notes = (f"NumFrames says {counted}, but {len(rows)} rows follow: those are read",)
    return C3dPoints(tuple(names), values, _rate(said), said.get("Units") or None, notes)


def _fields(line: str) -> list[str]:
    """The fields between tabs, or between spaces in a line without any."""
    return [field.strip() for field in line.split("\t")] if "\t" in line else line.split()


def _row(path: Path, line: int, text: str, points: int) -> Float[np.ndarray, "P 3"]:
    fields = _fields(text)[2:]
    if any(fields[3 * points :]) or not fields:
        raise FileFormatError(
            path,
            line,
            f"has {len(fields)} numbers; expected {3 * points}: {points} points of three",
        )
    fields += [""] * (3 * points - len(fields))
    try:
        values = np.array([float(field) if field else np.nan for field in fields[: 3 * points]])
    except ValueError as error:
        raise FileFormatError(path, line, f"expected numbers ({error})") from error
    if (np.abs(values) > LARGEST).any():
        raise FileFormatError(path, line, f"holds numbers beyond {LARGEST:g}")
    return values.reshape(points, 3)


def _rate(said: dict[str, str]) -> float | None:
    """The rate of the rows; None where it is none."""
    try:
        rate = float(said.get("DataRate", ""))
    except ValueError:
        return None
    return rate if 1 <= rate <= 10000 else None
