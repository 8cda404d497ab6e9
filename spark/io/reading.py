"""Motion files of any format, and the folders that hold them."""

from collections.abc import Iterator
from pathlib import Path

from spark.errors import FileFormatError
from spark.io.fbx import read_fbx
from spark.io.recording import Recording, read_recording

SUFFIXES = (".bvh", ".fbx")


def read_motion(
    path: str | Path, *, unit: str | float | None = None, up: str | None = None
) -> Recording:
    """The recording in a BVH or FBX file, told apart by the ending of its name (BVH by any other).

    Raises what `spark.io.recording.read_recording` and `spark.io.fbx.read_fbx` raise.
    """
    path = Path(path)
    read = read_fbx if path.suffix.lower() == ".fbx" else read_recording
    return read(path, unit=unit, up=up)


def motion_files(path: Path, suffixes: tuple[str, ...] = SUFFIXES) -> list[Path]:
    """The files of some endings below a folder, in order of their names; a file itself.

    Links are followed. Raises `FileFormatError` where there is none.
    """
    if path.is_file():
        return [path]
    if not path.is_dir():
        raise FileFormatError(path, None, "no such file or folder")
    found = sorted(p for p in _files(path, set()) if p.suffix.lower() in suffixes)
    if not found:
        raise FileFormatError(
            path, None, f"holds no {' or '.join(suffixes)} file; expected one or more"
        )
    return found


def _files(folder: Path, seen: set[Path]) -> Iterator[Path]:
    """All files below a folder, each folder once: a link may lead back to one above it."""
    if (real := folder.resolve()) in seen:
        return
    seen.add(real)
    for path in sorted(folder.iterdir()):
        if path.is_dir():
            yield from _files(path, seen)
        elif path.is_file():
            yield path
