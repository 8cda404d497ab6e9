"""What `spark-sim retarget` reads, and what it writes of each."""

from collections.abc import Sequence
from pathlib import Path

from robots.formats import is_sonic
from spark.errors import FileFormatError, OutputError
from spark.opening import real
from spark_sim.sources import LeftOut, find_motions, sentences

Job = tuple[Path, Path]
"""A file to read, and the file to write."""


def retarget_jobs(
    sources: Sequence[str], target: Path, output: str | None, ending: str, *, robot: bool
) -> tuple[list[Job], list[LeftOut]]:
    """Each motion with its result, and the files below folders that are left out. Raises
    `OutputError` where two results would collide.

    Below a folder given as a source the tree of folders is kept; what is written is no source.
    `robot` is whether the user says which robot moves in the sources.
    """
    given: list[Job] = []
    below: list[Job] = []
    left_out: list[LeftOut] = []
    for source in map(Path, sources):
        if not source.is_dir() or is_sonic(source):
            given.append((source, Path()))
            continue
        motions, others = find_motions(source, robot=robot)
        if not motions:
            why = "; ".join(sentences(others))
            raise FileFormatError(source, None, f"holds no motion to read; {why}")
        below += [(path, path.parent.relative_to(source)) for path in motions]
        left_out += others
    if output is not None and len(given) == 1 and not below and not _names_folder(output):
        return [(given[0][0], Path(output))], left_out
    folder = Path(output or ".")
    if folder.is_file():
        count = len(given) + len(below)
        raise OutputError(f"{folder}: is a file; expected a folder for {count} motions")

    def written(path: Path, place: Path) -> Path:
        return folder / place / f"{path.stem}_on_{target.stem}{ending}"

    ours = {real(written(*each)) for each in (*given, *below)}
    found = [*given, *(each for each in below if real(each[0]) not in ours)]
    jobs = [(path, written(path, place)) for path, place in found]
    _refuse_collisions(jobs)
    return jobs, left_out


def _refuse_collisions(jobs: Sequence[Job]) -> None:
    outputs: dict[Path, Path] = {}
    for path, out in jobs:
        if (other := outputs.setdefault(out, path)) != path:
            raise OutputError(f"{path} and {other} would both be written to {out}; rename one")
    if len(outputs) < len(jobs):
        twice = next(path for path, _ in jobs if [job[0] for job in jobs].count(path) > 1)
        raise OutputError(f"{twice} is given twice; give each motion once")


def _names_folder(output: str) -> bool:
    return output.endswith("/") or Path(output).is_dir()
