"""The JSON beside a robot's motion, or in its folder: what the motion's own file can't say. Read
without MuJoCo."""

from pathlib import Path
from typing import Any

from robots.formats import is_sonic
from spark.errors import FileFormatError
from spark.opening import LARGEST_TEXT, parse_json, read_bytes

SIDECAR = "spark-sim sidecar 1"


def facts_beside(path: Path) -> dict[str, Any]:
    """What is said of the motion at `path` beside it, or in the folder that it is; nothing where
    nothing is. Raises `FileFormatError` where the file beside it is broken."""
    return _info_of(path) if is_sonic(path) else read_sidecar(path) or {}


def read_sidecar(path: Path) -> dict[str, Any] | None:
    """What the file beside `path` says; None where there is none. Raises `FileFormatError` where it
    is broken."""
    beside = sidecar_of(path)
    if not beside.is_file():
        return None
    facts = parse_json(beside, read_bytes(beside, limit=LARGEST_TEXT), "all of it")
    if not isinstance(facts, dict) or facts.get("schema") != SIDECAR:
        return None  # another tool's
    return facts


def sidecar_of(path: Path) -> Path:
    """Where what `path` doesn't say stands: `walk.csv.json` beside `walk.csv`."""
    return path.with_name(f"{path.name}.json")


def _info_of(path: Path) -> dict[str, Any]:
    """What `info.txt` in a folder of SONIC's says, where it is ours."""
    info = path / "info.txt"
    try:
        facts = parse_json(info, read_bytes(info, limit=LARGEST_TEXT), "all of it")
    except FileFormatError:
        return {}
    return facts if isinstance(facts, dict) else {}
