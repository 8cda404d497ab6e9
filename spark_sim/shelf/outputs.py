"""The files of a folder's report: known again as its own, so that it may write them anew."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from spark.errors import OutputError
from spark.files import write_atomically
from spark.opening import loads_json
from spark_sim.files import check_free

_OUTPUTS: Final = "outputs.json"  # in the folder of the clips' pages


def claim_outputs(paths: Sequence[Path], clips: Path, *, force: bool) -> None:
    """Take the names of a report's files, and the folder of its clips' pages.

    What the same report wrote before is its own, until someone changes it. Raises `OutputError`
    where anything else is there, unless `force` is given.
    """
    ours = _written(clips)
    for path in paths:
        if path.is_file() and _sha256(path.read_bytes()) in ours.get(path.name, ()):
            continue
        check_free(path, force=force)
    if clips.exists() and not (clips / _OUTPUTS).is_file() and not force:
        raise OutputError(
            f"{clips}: exists; give another name with --html, or fill it anew with --force"
        )
    clips.mkdir(parents=True, exist_ok=True)
    if not ours:
        write_atomically(clips / _OUTPUTS, b"{}")


def write_outputs(contents: Mapping[Path, bytes], clips: Path) -> None:
    """Write a report's files. That they are its own is written first: a kill in between leaves
    what was there, or what is new, and both are known."""
    before = _written(clips)
    known = {
        path.name: [*before.get(path.name, [])[-1:], _sha256(content)]
        for path, content in contents.items()
    }
    write_atomically(clips / _OUTPUTS, json.dumps(known, indent=1).encode())
    for path, content in contents.items():
        write_atomically(path, content)


def _written(clips: Path) -> dict[str, list[str]]:
    try:
        found = loads_json((clips / _OUTPUTS).read_bytes())
    except (OSError, ValueError):
        return {}
    return found if isinstance(found, dict) else {}


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
