"""Motion files of any format, and the folders that hold them."""

from pathlib import Path

from spark.errors import FileFormatError
from spark.fbx import read_fbx
from spark.recording import Recording, read_recording

SUFFIXES = (".bvh", ".fbx")


def read_motion(
    path: str | Path, *, unit: str | float | None = None, up: str | None = None
) -> Recording:
    """The recording in a BVH or FBX file, told apart by the ending of its name (BVH by any other).

    Raises what `spark.recording.read_recording` and `spark.fbx.read_fbx` raise.
    """
    path = Path(path)
    read = read_fbx if path.suffix.lower() == ".fbx" else read_recording
    return read(path, unit=unit, up=up)


def motion_files(path: Path, suffixes: tuple[str, ...] = SUFFIXES) -> list[Path]:
    """The files of some endings below a folder, in order of their names; a file itself.

    Raises `FileFormatError` where there is none.
    """
    if path.is_file():
        return [path]
    found = sorted(p for p in path.rglob("*") if p.suffix.lower() in suffixes and p.is_file())
    if not found:
        raise FileFormatError(
            path, None, f"holds no {' or '.join(suffixes)} file; expected one or more"
        )
    return found
