"""What became of every motion of a batch: a line of JSON each, in `manifest.jsonl`.

A line is appended before its result takes its final name. So a file that no line names is not the
batch's own, and a line whose file is missing is work that was interrupted.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from spark.errors import FileFormatError
from spark.files import write_atomically

SCHEMA = "spark-sim manifest 1"
NAME = "manifest.jsonl"

Entry = dict[str, Any]
"""A line. Of the same `job` are the pieces of one motion on one target, all `finished` at once."""


class Manifest:
    """The lines of a batch's folder, by job. Where a job was done again, the latest lines count.

    Each shard has a file of its own, so that machines don't write to the same one; all are read.
    """

    def __init__(self, folder: Path, shard: str = "") -> None:
        self.folder = folder
        self.path = folder / (f"manifest-{shard}.jsonl" if shard else NAME)
        self._jobs: dict[str, list[Entry]] = {}
        self._file_of: dict[str, Path] = {}
        for path in sorted(folder.glob("manifest*.jsonl")):
            for entry in read(path):
                self._take(entry, path)

    def __iter__(self) -> Iterator[Entry]:
        return (entry for job in sorted(self._jobs) for entry in self._jobs[job])

    def of(self, job: str) -> list[Entry]:
        """The lines of a job; none where it was never done."""
        return list(self._jobs.get(job, ()))

    def add(self, entries: Sequence[Entry]) -> None:
        """Append the lines of a job, in one call of the operating system."""
        with self.path.open("ab", buffering=0) as file:
            file.write(_text(entries))
        for entry in entries:
            self._take(entry, self.path)

    def tidy(self, parts: Path) -> None:
        """The file anew, whole or not at all: the lines that count in the order of their names,
        and none that was torn. It is written in the folder `parts` before it takes its name."""
        own = (entry for entry in self if self._file_of[entry["job"]] == self.path)
        parts.mkdir(parents=True, exist_ok=True)
        made = parts / self.path.name
        write_atomically(made, _text(own))
        made.replace(self.path)

    def _take(self, entry: Entry, path: Path) -> None:
        job = entry["job"]
        lines = self._jobs.setdefault(job, [])
        if lines and lines[0]["finished"] > entry["finished"]:
            return
        if lines and lines[0]["finished"] < entry["finished"]:
            lines.clear()
        lines.append(entry)
        self._file_of[job] = path


def read(path: Path) -> list[Entry]:
    """The lines of a manifest. A last line that was torn by a kill is left out.

    Raises `FileFormatError` where any other is no entry.
    """
    *lines, _torn = path.read_bytes().split(b"\n")
    entries = []
    for number, line in enumerate(lines, 1):
        try:
            entry = json.loads(line)
        except ValueError as error:
            raise FileFormatError(path, number, "is no line of JSON; remove it") from error
        if not isinstance(entry, dict) or entry.get("schema") != SCHEMA:
            raise FileFormatError(path, number, f"is no entry of {SCHEMA!r}; remove it")
        entries.append(entry)
    return entries


def is_still(paths: Sequence[Path], entry: Mapping[str, Any], which: str) -> bool:
    """Whether files are what the line says of its "source" or "output": by size and time, or else
    by their bytes."""
    try:
        now = file_facts(paths, entry[f"{which}_sha256"])
        same_time = now["mtime_ns"] == entry[f"{which}_mtime_ns"]
        return now["bytes"] == entry[f"{which}_bytes"] and (
            same_time or file_facts(paths)["sha256"] == now["sha256"]
        )
    except OSError:
        return False


def file_facts(paths: Sequence[Path], known_sha256: str | None = None) -> dict[str, Any]:
    """Size, time and hash of a file; of several the sum, the latest, and the hash of the hashes."""
    stats = [path.stat() for path in paths]
    return {
        "sha256": known_sha256 or _sha256(paths),
        "bytes": sum(stat.st_size for stat in stats),
        "mtime_ns": max(stat.st_mtime_ns for stat in stats),
    }


def _sha256(paths: Sequence[Path]) -> str:
    hashes = [sha256(path) for path in paths]
    return hashes[0] if len(hashes) == 1 else hashlib.sha256("".join(hashes).encode()).hexdigest()


def sha256(path: Path) -> str:
    """Of a file's bytes, which are never all in memory."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _text(entries: Iterable[Entry]) -> bytes:
    return "".join(json.dumps(e, ensure_ascii=False) + "\n" for e in entries).encode()
