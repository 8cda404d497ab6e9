"""Where results go: nothing is overwritten unasked, and no file has an ending that says what it is
not. Both are said before the work, not after."""

import errno
import os
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from spark.errors import OutputError
from spark.files import alone
from spark_sim import console


def check_free(path: Path, *, force: bool) -> None:
    """Raise `OutputError` where `path` is a folder, or exists and `force` is not given."""
    if path.is_dir():
        raise OutputError(f"{path}: is a folder; expected the name of a file to write")
    if path.exists() and not force:
        raise OutputError(f"{path}: exists; give another name, or overwrite it with --force")


def check_not_read(paths: Iterable[Path], inputs: Iterable[Path]) -> None:
    """Raise `OutputError` where one of `paths` is one of the files that they would be made from:
    these are never overwritten, not even by force."""
    read = {_identity(path) for path in inputs if path.exists()}
    for path in paths:
        if path.exists() and _identity(path) in read:
            raise OutputError(
                f"{path}: is what the result is made from, and would be lost; give another name"
            )


def _identity(path: Path) -> tuple[int, int]:
    """What a file is the same by, whatever path leads to it."""
    found = path.stat()
    return found.st_dev, found.st_ino


def check_ending(path: Path, endings: tuple[str, ...], what: str) -> None:
    """Raise `OutputError` where `path` has none of the `endings` of `what` is written there."""
    if path.suffix.lower() not in endings:
        *several, last = endings
        known = f"{', '.join(several)} or {last}" if several else last
        has = f"not as {path.suffix}" if path.suffix else "and the name has no ending"
        raise OutputError(f"{path}: {what} is written as {known}, {has}")


def claim(path: Path, *, force: bool, endings: tuple[str, ...] = (), what: str = "it") -> None:
    """Make the folders on the way to `path`. Raises `OutputError` where it is not free, can't be
    written, or has none of the `endings` of `what` goes there: a motion is never overwritten by a
    model or a page of it, not even by force."""
    check_free(path, force=force)
    if endings:
        check_ending(path, endings, what)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{path}: can't make its folder ({error.strerror})") from error
    real = Path(os.path.realpath(path))
    if not real.parent.is_dir():
        raise OutputError(f"{path}: leads to {real}, and there is no such folder")
    if not os.access(real.parent, os.W_OK):
        raise OutputError(f"{path}: can't be written, its folder is read-only")


@contextmanager
def one_run(folder: Path, part: str = "") -> Iterator[None]:
    """Make `folder`, and keep other runs out of it, or out of a part of it. Where the system can't
    lock files there, a note says so. Raises `OutputError` where another run is in it."""
    with ExitStack() as held:
        try:
            held.enter_context(alone(folder, part))
        except OSError as error:
            if error.errno not in (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP):
                raise
            reason = f"can't be locked here ({error.strerror})"
            console.note(f"{folder}: {reason}: start one run in it alone")
        yield
