"""What became of every motion of a batch: a line of JSON each, in `manifest.jsonl`.

A line is appended before its result takes its final name. So a file that no line names is not the
batch's own, and a line whose file is missing is work that was interrupted.
"""

import json
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from spark.errors import FileFormatError
from spark.files import write_atomically
from spark.opening import loads_json

SCHEMA = "spark-sim manifest 1"
NAME = "manifest.jsonl"

Entry = dict[str, Any]
"""A line. Of the same `job` are the pieces of one motion on one target, all `finished` at once."""


@dataclass(slots=True)
class _Lines:
    """Where the lines of a job are: a file, its bytes from `start` to `stop`, and any elsewhere."""

    path: Path
    start: int
    stop: int
    finished: str
    more: "_Lines | None" = None


class Manifest:
    """The lines of a batch's folder, by job. Where a job was done again, the latest lines count.

    Each shard has a file of its own, so that machines don't write to the same one; all are read. In
    memory is where each job's lines are, and not what they say.
    """

    def __init__(self, folder: Path, shard: str = "") -> None:
        self.folder = folder
        self.path = folder / (f"manifest-{shard}.jsonl" if shard else NAME)
        self._of: dict[str, _Lines] = {}
        for path in sorted(folder.glob("manifest*.jsonl")):
            self._index(path)

    def __iter__(self) -> Iterator[Entry]:
        return (entry for job in sorted(self._of) for entry in self.of(job))

    def of(self, job: str) -> list[Entry]:
        """The lines of a job; none where it was never done."""
        try:
            return [loads_json(line) for line in self._bytes(job).splitlines()]
        except (OSError, ValueError):
            return []  # removed meanwhile, by another program

    def add(self, entries: Sequence[Entry]) -> None:
        """Append the lines of a job, in one call of the operating system."""
        text = _text(entries)
        with self.path.open("ab", buffering=0) as file:
            start = file.tell()
            file.write(text)
        first = entries[0]
        self._take(first["job"], _Lines(self.path, start, start + len(text), first["finished"]))

    def tidy(self, parts: Path) -> None:
        """The file anew, whole or not at all: the lines that count in the order of their names,
        and none that was torn. It is written in the folder `parts` before it takes its name."""
        own = [job for job in sorted(self._of) if self._of[job].path == self.path]
        if self._is_tidy(own):
            return
        parts.mkdir(parents=True, exist_ok=True)
        made = parts / self.path.name
        write_atomically(made, (self._bytes(job) for job in own))
        made.replace(self.path)
        self._index_again(self.path)

    def _is_tidy(self, own: Sequence[str]) -> bool:
        """Whether the file is the lines of these jobs one after the other, and nothing else."""
        end = 0
        for lines in (self._of[job] for job in own):
            if lines.start != end or lines.more is not None:
                return False
            end = lines.stop
        return self.path.is_file() and self.path.stat().st_size == end

    def _bytes(self, job: str) -> bytes:
        """The lines of a job as they are in the file. Where another process has put its lines in
        order meanwhile, they are looked for again."""
        text = b"".join(map(_read, self._spans(job)))
        if text and not _is_of(text, job):
            for path in {lines.path for lines in self._spans(job)}:
                self._index_again(path)
            text = b"".join(map(_read, self._spans(job)))
        return text

    def _spans(self, job: str) -> Iterator[_Lines]:
        lines = self._of.get(job)
        while lines is not None:
            yield lines
            lines = lines.more

    def _index(self, path: Path) -> None:
        """Find where each job's lines are in a file. A last line that was torn by a kill is left
        out.

        Raises `FileFormatError` where any other is no entry.
        """
        start = 0
        with path.open("rb") as file:
            for number, line in enumerate(file, 1):
                if not line.endswith(b"\n"):
                    break
                entry, stop = _entry(line, path, number), start + len(line)
                self._take(entry["job"], _Lines(path, start, stop, entry["finished"]))
                start = stop

    def _index_again(self, path: Path) -> None:
        for job in [job for job in self._of if any(s.path == path for s in self._spans(job))]:
            del self._of[job]
        self._index(path)

    def _take(self, job: str, new: _Lines) -> None:
        known = self._of.get(job)
        if known is None or known.finished < new.finished:
            self._of[job] = new
        elif known.finished == new.finished:
            last = known
            while last.more is not None:
                last = last.more
            if (last.path, last.stop) == (new.path, new.start):
                last.stop = new.stop
            else:
                last.more = new


def _entry(line: bytes, path: Path, number: int) -> Entry:
    try:
        entry = loads_json(line)
    except ValueError as error:
        raise FileFormatError(path, number, "is no line of JSON; remove it") from error
    if not isinstance(entry, dict) or entry.get("schema") != SCHEMA:
        raise FileFormatError(path, number, f"is no entry of {SCHEMA!r}; remove it")
    return entry


def _read(lines: _Lines) -> bytes:
    with lines.path.open("rb") as file:
        file.seek(lines.start)
        return file.read(lines.stop - lines.start)


def _is_of(text: bytes, job: str) -> bool:
    """Whether bytes of a manifest are whole lines of a job."""
    try:
        return all(loads_json(line)["job"] == job for line in text.splitlines())
    except (ValueError, TypeError, KeyError):
        return False


def _text(entries: Iterable[Entry]) -> bytes:
    return b"".join(_line(entry) for entry in entries)


def _line(entry: Entry) -> bytes:
    try:
        return json.dumps(entry, ensure_ascii=False).encode() + b"\n"
    except UnicodeEncodeError:  # a file's name that is no text
        return json.dumps(entry).encode() + b"\n"
