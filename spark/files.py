"""Files written whole or not at all."""

import os
import stat
from pathlib import Path

from spark.errors import OutputError


def write_atomically(path: Path, data: bytes) -> None:
    """Write `data` to `path` through a neighbour that then takes its name.

    A reader never sees half of it, and a failure leaves what was there. An existing file is
    replaced. Raises `OutputError` where the folder is missing or read-only, or `path` is a folder
    or a device.
    """
    neighbour = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        if path.exists() and not stat.S_ISREG(path.stat().st_mode):
            raise OutputError(f"{path}: is not a regular file; give the name of a file to write")
        try:
            neighbour.write_bytes(data)
            neighbour.replace(path.resolve())
        finally:
            neighbour.unlink(missing_ok=True)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise OutputError(
            f"{path}: can't be written ({reason}); expected an existing folder that may be written"
        ) from error
