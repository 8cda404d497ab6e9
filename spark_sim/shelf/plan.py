"""What a batch has to do: one job for each source, target and side."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from robots.formats import FORMATS
from robots.registry import is_robot
from spark.errors import ConventionError, FileFormatError, OutputError
from spark.opening import real
from spark_sim.choices import Format, Method
from spark_sim.shelf.made_of import reading_sha256
from spark_sim.sources import LeftOut, find_motions, sentences


@dataclass(frozen=True)
class Options:
    """What is done with every motion.

    `cut` [s] is the longest that a piece may be. `reading` and `target` are what is given of the
    sources and of the targets, as `spark_sim.load` takes it.
    """

    method: Method = "spark"
    format: Format | None = None
    fps: float | None = None
    cut: float | None = None
    reading: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def reading_sha256(self) -> dict[str, str]:
        """Of the files that `reading` names. Raises `SparkSimError` where one can't be read."""
        return reading_sha256(self.reading)


@dataclass(frozen=True)
class Job:
    """A motion onto a target, as it is or `mirrored`.

    `output` is the file of the whole motion, relative to the batch's folder; of a motion that is
    cut, each piece has a file named after it.
    """

    source: Path
    target: str
    output: Path
    mirrored: bool
    options: Options

    @property
    def record(self) -> dict[str, Any]:
        """The options as the manifest has them: the same options make the same file."""
        options = self.options
        return {
            "method": options.method,
            "format": options.format,
            "fps": options.fps,
            "cut": options.cut,
            "mirrored": self.mirrored,
            "reading": {name: str(value) for name, value in sorted(options.reading.items())},
            "reading_sha256": options.reading_sha256,
        }


class Plan(NamedTuple):
    """What there is to do, and the files below the sources that are no motions to read."""

    jobs: list[Job]
    left_out: list[LeftOut]


def plan(
    sources: Sequence[str],
    targets: Sequence[str],
    out: Path,
    options: Options,
    *,
    mirror: bool = False,
) -> Plan:
    """Every motion below the sources onto every target: `OUT/TARGET/` holds the tree of folders.

    Below several sources each tree stands in a folder of the source's own name. What lies in `out`
    is no source. Raises `OutputError` where two results would have one name.
    """
    found, left_out = _found(sources, out, robot="robot" in options.reading)
    folders = _folders(targets)
    jobs: list[Job] = []
    for source, below in found:
        for target, folder in zip(targets, folders, strict=True):
            ending = _ending(target, options.format)
            jobs += [
                Job(source, target, Path(folder, f"{below}{side}{ending}"), bool(side), options)
                for side in (("", "_mirrored") if mirror else ("",))
            ]
    _refuse_clashes(jobs)
    return Plan(jobs, left_out)


def _ending(target: str, format: Format | None) -> str:
    """The ending of results on a target. Raises `OutputError` where the format does not go."""
    if is_robot(target):
        return FORMATS[format or "npz"]
    if format is not None:
        raise OutputError(f"--format is for robots; {target} is a character")
    return ".bvh"


def _found(
    sources: Sequence[str], out: Path, *, robot: bool
) -> tuple[list[tuple[Path, str]], list[LeftOut]]:
    """The files to read, each with the name of its result without ending; and those left out."""
    folders = [Path(source) for source in sources if Path(source).is_dir()]
    made, found = real(out), []
    left_out: list[LeftOut] = []
    for source in map(Path, sources):
        own = Path(real(source).name) if len(folders) > 1 else Path()
        if not source.is_dir():
            if not source.is_file():
                raise FileFormatError(source, None, "no such file or folder")
            found.append((source, Path()))
            continue
        motions, others = find_motions(source, robot=robot)
        paths = [path for path in motions if not real(path).is_relative_to(made)]
        left_out += [each for each in others if not real(each.path).is_relative_to(made)]
        if not paths:
            why = "; ".join(sentences(left_out)) or "expected one or more"
            raise FileFormatError(source, None, f"holds no motion to read outside {out}; {why}")
        found += [(path, own / path.parent.relative_to(source)) for path in paths]
    named: list[tuple[Path, str]] = []
    taken: set[str] = set()
    for path, below in found:
        # The second of walk.bvh and walk.fbx keeps its ending.
        stem = str(below / path.stem)
        name = str(below / path.name) if stem in taken else stem
        taken.add(stem)
        named.append((path, name))
    return named, left_out


def _folders(targets: Sequence[str]) -> list[str]:
    """A folder's name for each target: its own, without folders and ending."""
    names = [Path(target).stem for target in targets]
    if len({*targets}) < len(targets):
        raise ConventionError("--to names a target twice; give each once")
    for name in names:
        if names.count(name) > 1:
            both = " and ".join(t for t, n in zip(targets, names, strict=True) if n == name)
            raise ConventionError(f"{both} would both be written to {name}/; rename one")
    return names


def _refuse_clashes(jobs: Sequence[Job]) -> None:
    outputs: dict[str, Job] = {}
    for job in jobs:
        other = outputs.setdefault(os.path.normcase(job.output), job)
        if other is not job:
            raise OutputError(
                f"{other.source} and {job.source} would both be written to {job.output}; rename one"
            )
