"""The JSON beside a robot's motion: what the motion's own file can't say. Read without MuJoCo."""

from pathlib import Path
from typing import Any

from spark.opening import LARGEST_TEXT, parse_json, read_bytes

SIDECAR = "spark-sim sidecar 1"


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
