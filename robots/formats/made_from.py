"""What a robot's motion was made from: told when it is written, and read again from its file, or
the JSON beside it, without MuJoCo."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from robots.formats.sidecar import facts_beside
from spark.errors import FileFormatError
from spark.npz import Npz
from spark.opening import parse_json


class Source(NamedTuple):
    """The file that a motion is made from, and its first and last time [s] there; None is all."""

    path: Path
    part: tuple[float, float] | None = None


@dataclass(frozen=True)
class MadeFrom:
    """The name of that file, its SHA-256, and the `part` of it [s], as the motion's file says."""

    name: str
    sha256: str
    part: tuple[float, float] | None = None

    def is_of(self, path: Path) -> bool:
        """Whether `path` is that file, whatever it is called now."""
        return sha256_of(path) == self.sha256


def record_of(source: Source | None) -> dict[str, Any]:
    """What a motion's file says of its source."""
    return {
        "source": None if source is None else source.path.name,
        "source_sha256": None if source is None else sha256_of(source.path),
        "source_part_s": None if source is None or source.part is None else list(source.part),
    }


def made_from(path: Path) -> MadeFrom | None:
    """What the motion at `path` was made from; None where its file doesn't say, or is broken."""
    try:
        facts = _facts_of(path)
    except (FileFormatError, OSError):
        return None
    name, sha256 = facts.get("source"), facts.get("source_sha256")
    if not isinstance(name, str) or not isinstance(sha256, str):
        return None
    return MadeFrom(name, sha256, _part(facts.get("source_part_s")))


def sha256_of(path: Path) -> str | None:
    """Of a file's bytes; None of what is no file."""
    if not path.is_file():
        return None
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _facts_of(path: Path) -> dict[str, Any]:
    if path.suffix.lower() != ".npz":
        return facts_beside(path)
    arrays = Npz(path, expected="the motion of a robot")
    facts = parse_json(path, str(arrays["about"]), "'about'") if "about" in arrays else None
    return facts if isinstance(facts, dict) else {}


def _part(value: Any) -> tuple[float, float] | None:
    if not isinstance(value, list) or len(value) != 2:
        return None
    first, last = value
    if not all(isinstance(t, float | int) and 0 <= t < float("inf") for t in value):
        return None
    return (float(first), float(last)) if first <= last else None
