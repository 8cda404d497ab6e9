"""A robot's motion as files, of ours and of the field's tools; one module a format.

What is here loads no MuJoCo: `robots.formats.dispatch` reads and writes.
"""

from pathlib import Path

from spark.errors import OutputError

SUFFIXES = (".npz", ".csv", ".pkl")
FORMATS = {"npz": ".npz", "mjlab": ".npz", "csv": ".csv", "csv-wxyz": ".csv", "gmr": ".pkl"}
"""The formats by name, and the ending of their files. The first of an ending is its default."""
QUATERNIONS = {"npz": "wxyz", "mjlab": "wxyz", "csv": "xyzw", "csv-wxyz": "wxyz", "gmr": "xyzw"}


def unsaid(format: str, fps: float) -> tuple[str, ...]:
    """What a file in this format does not say, but has to be known."""
    if FORMATS[format] == ".csv":
        order = QUATERNIONS[format]
        return (
            f"x y z [m], quaternion {order}, joints [rad]; {fps:.6g} fps, which it doesn't say",
        )
    if format == "mjlab":
        return (f"{fps:.6g} fps, the source's; trackers may expect another rate, often 50",)
    return ()


def format_of(path: Path, format: str | None = None) -> str:
    """The format to write `path` in. Raises `OutputError` where there is none, or not that one."""
    suffix = path.suffix.lower()
    if format is None:
        found = next((name for name, ending in FORMATS.items() if ending == suffix), None)
        if found is None:
            raise OutputError(
                f"{path}: a robot's motion is written as {', '.join(SUFFIXES)}; name it so"
            )
        return found
    if format not in FORMATS:
        raise OutputError(f"format {format!r} is not known; expected one of {', '.join(FORMATS)}")
    if FORMATS[format] != suffix:
        raise OutputError(f"{path}: the format {format!r} is written as {FORMATS[format]}")
    return format
