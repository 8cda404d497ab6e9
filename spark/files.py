"""Files written whole or not at all, and folders that one process writes to at a time."""

import errno
import os
import stat
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import count
from pathlib import Path

from spark.errors import OutputError

_PART = ".spark-sim-{}-{}.part"
_NUMBERS = count()


def write_atomically(path: Path, data: bytes | Iterable[bytes]) -> None:
    """Write `data`, in one piece or several, to `path`, as `replacing` does it. A pipe or a device
    takes the data as it is."""
    pieces = [data] if isinstance(data, bytes) else data
    if os.path.exists(path) and not os.path.isfile(path):
        with _named(path), path.open("wb") as file:
            file.writelines(pieces)
        return
    with replacing(path) as neighbour, _named(path), neighbour.open("wb") as file:
        file.writelines(pieces)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A name beside `path` to write a file to. The file becomes `path` once the block is done and
    its bytes are on the disk; a block that fails or is killed leaves what was there.

    A reader never sees half of it. A link stays one: the file that it leads to is replaced, with
    its permissions. Raises `OutputError` where `path` can't be written.
    """
    with _named(path):
        try:
            real = Path(os.path.realpath(path))
        except ValueError as error:  # a NUL in the name
            raise OSError(None, str(error)) from error
    # Short, so that the longest name that fits can be written too.
    neighbour = real.with_name(_PART.format(os.getpid(), next(_NUMBERS)))
    try:
        yield neighbour
        with _named(path):
            _to_disk(neighbour, os.O_RDWR)
            with suppress(FileNotFoundError):
                neighbour.chmod(stat.S_IMODE(real.stat().st_mode))
            neighbour.replace(real)
            with suppress(OSError):  # not every system lets a folder be opened
                _to_disk(real.parent, os.O_RDONLY)
    finally:
        with suppress(OSError):
            neighbour.unlink()


@contextmanager
def alone(folder: Path, part: str = "") -> Iterator[None]:
    """Make `folder`, and keep other processes that ask for it, or for the same part of it, out
    meanwhile.

    Raises `OutputError` where another one is in it, or where it can't be made.
    """
    with _named(folder):
        folder.mkdir(parents=True, exist_ok=True)
        name = f".spark-sim-{part}.lock" if part else ".spark-sim.lock"
        lock = os.open(folder / name, os.O_RDWR | os.O_CREAT, 0o666)
    try:
        try:
            _lock(lock)
        except (BlockingIOError, PermissionError) as error:
            raise OutputError(
                f"{folder}: another run is writing to it; wait until that ends, or give another "
                "folder"
            ) from error
        yield
    finally:
        os.close(lock)  # the system also does this when a process is killed


def sweep(folder: Path) -> None:
    """Remove what processes that were killed left half written in `folder`; none is in it now."""
    for left in folder.glob(_PART.format("*", "*")):
        left.unlink(missing_ok=True)


def _lock(file: int) -> None:
    """Hold `file` until it is closed. Raises `OSError` where another process holds it."""
    if sys.platform == "win32":
        import msvcrt

        msvcrt.locking(file, msvcrt.LK_NBLCK, 1)
    else:
        import fcntl

        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _to_disk(path: Path, flags: int) -> None:
    """Wait until what was written to `path` would survive a power cut."""
    file = os.open(path, flags)
    try:
        os.fsync(file)
    finally:
        os.close(file)


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Failures of the system as errors that name `path`."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or error
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        wanted = "a file name in a folder that exists and may be written to"
        raise OutputError(
            f"{path}: can't be written ({reason}); "
            f"{'make room there, or write elsewhere' if full else f'expected {wanted}'}"
        ) from error
