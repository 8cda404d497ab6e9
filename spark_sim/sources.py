"""Which files of a folder are motions to read, and which are left out, and why."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from robots.formats import SUFFIXES as ROBOTS
from robots.formats.sidecar import read_sidecar
from spark.errors import FileFormatError
from spark.io.arrays import npz_names
from spark.io.reading import SUFFIXES as CHARACTERS
from spark.io.reading import holds_person, motion_files
from spark.summary import counted

ENDINGS = tuple(dict.fromkeys((*CHARACTERS, *ROBOTS)))
_WHOSE = "a robot's motion that names no robot: --robot does"
_BROKEN = "can't be read"
_OTHER = "holds no motion that is known"
_NAMED = 20  # files of a kind that a note names


class LeftOut(NamedTuple):
    """A file that is not read, and why."""

    path: Path
    reason: str


class Found(NamedTuple):
    """The motions below a folder, in the order of their names, and what only ends like some."""

    motions: list[Path]
    left_out: list[LeftOut]


def find_motions(folder: Path, *, robot: bool) -> Found:
    """The motions of characters and people below a folder, and of robots: where their file, or the
    JSON beside it, says which robot moves, or the user does (`robot`).

    Raises `FileFormatError` where no file has the ending of a motion's.
    """
    found = Found([], [])
    for path in motion_files(folder, ENDINGS):
        if path.suffix.lower() == ".asf":  # a skeleton, which its AMCs move
            continue
        reason = _reason(path, robot)
        if reason is None:
            found.motions.append(path)
        else:
            found.left_out.append(LeftOut(path, reason))
    return found


def sentences(left_out: Sequence[LeftOut]) -> Iterator[str]:
    """What there is to say of the files that are left out: each kind, with its number and names."""
    for reason in dict.fromkeys(each.reason for each in left_out):
        paths = [str(each.path) for each in left_out if each.reason == reason]
        named = ", ".join(paths[:_NAMED])
        more = f" and {len(paths) - _NAMED} more" if len(paths) > _NAMED else ""
        yield f"{counted(len(paths), 'file')} left out ({reason}): {named}{more}"


def _reason(path: Path, robot: bool) -> str | None:
    """Why a file is left out; None where it is a motion to read."""
    ending = path.suffix.lower()
    if holds_person(path) or (robot and ending in ROBOTS):
        return None
    if ending not in ROBOTS:
        return _OTHER
    if ending == ".npz":
        names = npz_names(path)
        if "about" in names:
            return None
        return _WHOSE if names else _BROKEN
    try:
        return None if "model" in (read_sidecar(path) or {}) else _WHOSE
    except FileFormatError:
        return _BROKEN
