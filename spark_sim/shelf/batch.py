"""A batch: what is missing or changed is made, and each result takes its name when it is whole."""

import os
import re
import shutil
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from secrets import token_hex
from typing import Any, TypeAlias

from spark_sim.shelf.duplicates import Duplicates, near_duplicates
from spark_sim.shelf.keep import Keep
from spark_sim.shelf.made_of import is_still, is_still_made_of, target_sha256
from spark_sim.shelf.manifest import SCHEMA, Entry, Manifest
from spark_sim.shelf.plan import Job
from spark_sim.shelf.processes import Died
from spark_sim.shelf.tally import Tally
from spark_sim.shelf.work import Done, work
from spark_sim.version import own_version

Backend: TypeAlias = Callable[
    [Callable[[Job], Done], Iterable[Job]], Iterator[tuple[Job, Done | Died]]
]
"""Does jobs, in any order; `spark_sim.shelf.processes.in_processes` is one."""


class Batch:
    """A folder of results with its manifest, for the time of one run.

    `shard` is the name of one of several runs that share the folder.
    """

    def __init__(
        self, folder: Path, *, keep: Keep | None = None, shard: str = "", force: bool = False
    ) -> None:
        self.folder, self.keep, self.force = folder, keep, force
        self._all_parts = folder / (f".part-{shard}" if shard else ".part")
        shutil.rmtree(self._all_parts, ignore_errors=True)
        # Of this run alone: the workers of one that was killed may still write.
        self.parts = self._all_parts / token_hex(4)
        self.manifest = Manifest(folder, shard)
        self.manifest.tidy(self.parts)
        self.tally = Tally()
        self._version = own_version()
        self._written_by = {
            output: entry["job"]
            for entry in self.manifest
            for output in (entry["files"] if entry["status"] == "written" else entry["stale"])
        }

    def run(self, jobs: Sequence[Job], backend: Backend) -> Iterator[tuple[Job, list[Entry]]]:
        """Do what is missing or changed, the largest files first; yields each job as it is done,
        with its lines of the manifest. What is unchanged comes first."""
        targets = {target: target_sha256(target) for target in {job.target for job in jobs}}
        missing = []
        for job in jobs:
            if self._is_done(job, targets[job.target]):
                yield job, self._decided_again(job)
            elif taken := self._taken(job):
                yield job, self._commit(job, targets[job.target], Done((), {}, 0.0, taken))
            else:
                missing.append(job)
        sizes = {source: _size(source) for source in {job.source for job in missing}}
        missing.sort(key=lambda job: (-sizes[job.source], str(job.source), job.target))
        total = sum(sizes[job.source] for job in missing) or 1
        try:
            for job, done in backend(partial(_work_below, self.parts), missing):
                if isinstance(done, Died):
                    done = Done((), {}, 0.0, str(done))
                self.tally.share += sizes[job.source] / total
                yield job, self._commit(job, targets[job.target], done)
        finally:
            self.manifest.tidy(self.parts)
            shutil.rmtree(self._all_parts, ignore_errors=True)

    def near_duplicates(self, jobs: Sequence[Job]) -> Duplicates:
        """Sources, or pieces of them, that hold nearly the same motion, or a part of another's."""
        prints: dict[str, str] = {}
        for job in jobs:
            for entry in self.manifest.of(job.output.as_posix()) if not job.mirrored else ():
                if entry["status"] != "failed":
                    span = f" from {entry['start_s']:.4g} s" if entry["pieces"] > 1 else ""
                    prints[f"{entry['source']}{span}"] = entry["fingerprint"]
        return near_duplicates(prints)

    def _is_done(self, job: Job, target: str) -> bool:
        """Whether the manifest's lines of a job, and its files, are what it would make again."""
        entries = self.manifest.of(job.output.as_posix())
        return (
            bool(entries)
            and len(entries) == entries[0]["pieces"]
            and all(
                entry["options"] == job.record
                and entry["target_sha256"] == target
                and entry["version"] == self._version
                and self._is_there(entry)
                for entry in entries
            )
            and is_still_made_of(job.source, _part(entries[0], "source_"))
        )

    def _is_there(self, entry: Entry) -> bool:
        if entry["status"] == "written":
            files = [self.folder / file for file in entry["files"]]
            return is_still(files, _part(entry, "output_"))
        return entry["status"] == "left out" and not self._keeps(entry)

    def _keeps(self, entry: Entry) -> bool:
        return self.keep is None or self.keep(entry["report"])

    def _decided_again(self, job: Job) -> list[Entry]:
        """The lines of a job that is done, under the `keep` of this run: what was kept may not be
        any longer."""
        entries = self.manifest.of(job.output.as_posix())
        fallen = [e for e in entries if e["status"] == "written" and not self._keeps(e)]
        if fallen:
            for file in (file for entry in fallen for file in entry["files"]):
                (self.folder / file).unlink(missing_ok=True)
            entries = [{**e, "status": "left out"} if e in fallen else e for e in entries]
            now = _now()
            self.manifest.add([{**entry, "finished": now} for entry in entries])
        kept = sum(entry["status"] == "written" for entry in entries)
        self.tally.unchanged += kept
        self.tally.left_out += len(entries) - kept
        return entries

    def _taken(self, job: Job) -> str | None:
        """What is wrong where a file that the batch did not write has the name of a result."""
        free = self._is_free(job.output.as_posix(), job)
        return None if free else _exists(self.folder / job.output)

    def _files_of(self, job: Job) -> set[str]:
        """The files that the job wrote when it was done last."""
        name = job.output.as_posix()
        listed = (e["files"] or e["stale"] for e in self.manifest.of(name))
        return {file for files in listed for file in files if self._written_by.get(file) == name}

    def _is_free(self, file: str, job: Job) -> bool:
        owner = self._written_by.get(file)
        if owner is not None:
            return owner == job.output.as_posix()
        path = self.folder / file
        # A result that is a folder fills it file by file.
        return self.force or not os.path.lexists(path) or (not path.suffix and path.is_dir())

    def _commit(self, job: Job, target: str, done: Done) -> list[Entry]:
        """Give the results of a job their names, and the manifest its lines."""
        ours = self._files_of(job)
        beside = job.output.parent
        files = [[(beside / file).as_posix() for file in piece.files] for piece in done.pieces]
        error = done.error
        if taken := [f for group in files for f in group if not self._is_free(f, job)]:
            error = _exists(self.folder / taken[0])
        entry: Entry = {
            "schema": SCHEMA,
            "status": "failed",
            "job": job.output.as_posix(),
            "output": None,
            "files": [],
            "source": str(job.source),
            "source_from_here": os.path.relpath(job.source, self.folder),
            "target": job.target,
            "target_sha256": target,
            "options": job.record,
            "version": self._version,
            "finished": _now(),
            "seconds": round(done.seconds, 3),
            "pieces": 1,
            "error": error,
            **done.source,
        }
        if error is not None:
            # What was made before stays, and stays the batch's own.
            entries = [entry | {"stale": sorted(ours)}]
            self.manifest.add(entries)
            self.tally.reasons.append((str(job.source), _reason(error, job.source)))
            return entries
        entries = [
            entry
            | {"output": (beside / piece.name).as_posix(), "files": group, "stale": []}
            | {"pieces": len(files), **piece.facts}
            for group, piece in zip(files, done.pieces, strict=True)
        ]
        for each in entries:
            each["status"] = "written" if self._keeps(each) else "left out"
        kept = [each for each in entries if each["status"] == "written"]
        # The order matters where a kill comes between: a line without its file is made again.
        for old in ours - {file for each in kept for file in each["files"]}:
            (self.folder / old).unlink(missing_ok=True)
            del self._written_by[old]
        self.manifest.add(entries)
        for file in (file for each in kept for file in each["files"]):
            (self.folder / file).parent.mkdir(parents=True, exist_ok=True)
            made = self.parts / job.output / Path(file).relative_to(beside)
            made.replace(self.folder / file)
            self._written_by[file] = job.output.as_posix()
        shutil.rmtree(self.parts / job.output, ignore_errors=True)
        self.tally.written += len(kept)
        self.tally.left_out += len(entries) - len(kept)
        self.tally.frames += sum(each["frames"] for each in entries)
        return entries


def _part(entry: Entry, which: str) -> dict[str, Any]:
    """What a line says of its "source_" or its "output_"."""
    return {
        name.removeprefix(which): value for name, value in entry.items() if name.startswith(which)
    }


def _work_below(parts: Path, job: Job) -> Done:
    return work(job, parts / job.output)


def _reason(error: str, source: Path) -> str:
    """An error without the file's own name, so that files that fail alike are counted together."""
    error = error.removeprefix(f"{source}: ")
    line = re.match(rf"{re.escape(str(source))}:(\d+): ", error)
    return error if line is None else f"line {line[1]}: {error[line.end() :]}"


def _exists(path: Path) -> str:
    return f"{path}: exists, and this batch did not write it; move it, or overwrite with --force"


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="microseconds")
