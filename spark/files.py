"""Files written whole or not at all."""

import os
from pathlib import Path

from spark.errors import OutputError


def write_atomically(path: Path, data: bytes) -> None:
    """Write `data` to `path` through a neighbour that then takes its name.

    A reader never sees half of it, and a failure leaves what was there. An existing file is
    replaced; a pipe or a device takes the data as it is. Raises `OutputError` where `path` can't be
    written.
    """
    neighbour = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        if path.exists() and not path.is_file():
            path.write_bytes(data)
            return
        try:
            neighbour.write_bytes(data)
            neighbour.replace(path.resolve())
        finally:
            neighbour.unlink(missing_ok=True)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise OutputError(
            f"{path}: can't be written ({reason}); expected a file name in a folder that exists "
            "and may be written to"
        ) from error
