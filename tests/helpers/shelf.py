"""A batch whose jobs only write their source's numbers: quick enough to be killed many times."""

import hashlib
import json
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from spark.files import alone
from spark_sim.shelf import batch
from spark_sim.shelf.made_of import file_facts
from spark_sim.shelf.plan import Job, Options, plan
from spark_sim.shelf.processes import Died
from spark_sim.shelf.tally import Tally
from spark_sim.shelf.work import Done, Piece

BLOCKS = 8  # in which a result is written


def serially(work: Callable[[Job], Done], jobs: Iterable[Job]) -> Iterator[tuple[Job, Done | Died]]:
    for job in jobs:
        yield job, work(job)


def contents(text: str, number: int) -> bytes:
    """The result of a source of this text, its piece of this number."""
    return b"".join(
        hashlib.sha512(f"{text} {number} {k}".encode()).digest() * 50 for k in range(BLOCKS)
    )


def made(job: Job, folder: Path) -> Done:
    """A source says how many pieces it has. They are written slowly, and not atomically."""
    text = job.source.read_text()
    source = {f"source_{name}": value for name, value in file_facts([job.source]).items()}
    if text == "broken":
        return Done((), source, 0.0, f"{job.source}: is broken")
    pieces = []
    folder.mkdir(parents=True, exist_ok=True)
    count = int(text.split()[0])
    for number in range(count):
        suffix = f"_cut{number:02}" if count > 1 else ""
        path = folder / f"{job.output.stem}{suffix}{job.output.suffix}"
        whole = contents(text, number)
        with path.open("wb", buffering=0) as file:
            for k in range(BLOCKS):
                file.write(whole[k * len(whole) // BLOCKS : (k + 1) * len(whole) // BLOCKS])
                time.sleep(1e-4)
        facts = {f"output_{name}": value for name, value in file_facts([path]).items()}
        report = {"implausible_share": 0.1 * number}
        pieces.append(
            Piece(
                Path(path.name),
                (Path(path.name),),
                facts | {"frames": 1, "report": report, "notes": []},
            )
        )
    return Done(tuple(pieces), source, 0.0)


def run(folder: Path, out: Path, **settings: object) -> Tally:
    """A batch of all files in a folder."""
    batch.work = made  # type: ignore[attr-defined]
    jobs = plan([str(folder)], ["robot"], out, Options()).jobs
    with alone(out):
        made_now = batch.Batch(out, **settings)
        list(made_now.run(jobs, serially))
    return made_now.tally


def results(out: Path) -> dict[str, bytes]:
    """The files under final names."""
    return {
        path.relative_to(out).as_posix(): path.read_bytes()
        for path in sorted((out / "robot").rglob("*"))
        if path.is_file()
    }


def lines(out: Path) -> list[dict[str, object]]:
    """The manifest without what differs between two runs that do the same."""
    drop = ("finished", "seconds", "source_mtime_ns", "output_mtime_ns")
    return [
        {name: value for name, value in json.loads(line).items() if name not in drop}
        for line in (out / "manifest.jsonl").read_text().splitlines()
    ]
