"""A robot's motion as files, of ours and of the field's tools; one module a format.

What is here loads no MuJoCo: `robots.formats.dispatch` reads and writes.
"""

from pathlib import Path

from spark.errors import OutputError

FORMATS = {
    "npz": ".npz",
    "mjlab": ".npz",
    "beyondmimic": ".npz",
    "holosoma": ".npz",
    "holomotion": ".npz",
    "locomujoco": ".npz",
    "csv": ".csv",
    "csv-wxyz": ".csv",
    "bones-seed": ".csv",
    "gmr": ".pkl",
    "protomotions": ".motion",
    "sonic": "",
}
"""The formats by name, and the ending of their files; "" is a folder. The first of an ending is its
default."""
SUFFIXES = tuple(dict.fromkeys(ending for ending in FORMATS.values() if ending))
SIDECARS = ("csv", "csv-wxyz", "bones-seed", "gmr")
"""Formats that say too little of themselves: the rest is written beside them, as JSON."""
SONIC_FPS = 50.0
SONIC_FILES = (
    *("joint_pos.csv", "joint_vel.csv", "body_pos.csv", "body_quat.csv"),
    *("body_lin_vel.csv", "body_ang_vel.csv", "metadata.txt", "info.txt"),
)
_TRACKERS = ("mjlab", "beyondmimic", "holosoma", "holomotion", "locomujoco", "protomotions")


def unsaid(path: Path, format: str, fps: float) -> tuple[str, ...]:
    """What a file in this format does not say, but has to be known."""
    if format in SIDECARS:
        return (f"{path.name}.json beside it says its rate, orders and units: keep them together",)
    if format in _TRACKERS and abs(fps - SONIC_FPS) > 0.5:
        return (f"{fps:.6g} fps; trackers mostly expect 50: --fps 50",)
    return ()


def format_of(path: Path, format: str | None = None) -> str:
    """The format to write `path` in. Raises `OutputError` where there is none, or not that one."""
    suffix = path.suffix.lower()
    if format is None:
        found = next((name for name, ending in FORMATS.items() if ending == suffix != ""), None)
        if found is None:
            raise OutputError(
                f"{path}: a robot's motion is written as {', '.join(SUFFIXES)}; name it so (or "
                "choose a folder of CSVs: --format sonic)"
            )
        return found
    if format not in FORMATS:
        raise OutputError(f"format {format!r} is not known; expected one of {', '.join(FORMATS)}")
    ending = FORMATS[format]
    if ending and ending != suffix:
        raise OutputError(f"{path}: the format {format!r} is written as {ending}")
    if not ending and suffix in SUFFIXES:
        raise OutputError(f"{path}: the format {format!r} is a folder; name it without {suffix}")
    return format


def written_files(path: Path, format: str | None = None) -> tuple[Path, ...]:
    """The files that a motion at `path` is written to."""
    name = format_of(path, format)
    if name == "sonic":
        return tuple(path / file for file in SONIC_FILES)
    return (path, path.with_name(f"{path.name}.json")) if name in SIDECARS else (path,)


def taken_files(path: Path, format: str | None = None) -> tuple[Path, ...]:
    """Those, and that of its ground where `path` has no room for it."""
    ground = () if format_of(path, format) == "npz" else (terrain_beside(path),)
    return (*written_files(path, format), *ground)


def terrain_beside(path: Path) -> Path:
    """The OBJ [m, Z up] of the stated ground of a motion at `path`, which only our npz has itself:
    in its folder where it is one."""
    if path.suffix.lower() in SUFFIXES:
        return path.with_name(f"{path.name}.terrain.obj")
    return path / "terrain.obj"


def is_sonic(path: Path) -> bool:
    """Whether a folder holds one motion, as SONIC's deployment reads them."""
    return path.is_dir() and (path / "joint_pos.csv").is_file()
