"""The motions of a folder, and what has to be known to read and judge each."""

import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from robots.formats import FORMATS, SUFFIXES
from robots.formats.made_from import made_from
from robots.registry import is_robot
from spark.errors import FileFormatError
from spark.io.arrays import npz_names
from spark.io.reading import motion_files
from spark_sim.shelf.manifest import Entry, Manifest
from spark_sim.sources import ENDINGS


@dataclass(frozen=True)
class Origin:
    """What a motion was made from: a file, from `start` [s] on, left and right exchanged or not."""

    path: Path
    reading: Mapping[str, Any] = field(default_factory=dict)
    start: float = 0.0
    mirrored: bool = False


@dataclass(frozen=True)
class Item:
    """A motion by its `name` in the folder, with its `origin` where that is known. `reading` is
    what `spark_sim.load` must be given. `target` is the body that a batch put it on."""

    path: Path
    name: str
    reading: Mapping[str, Any]
    origin: Origin | None = None
    target: str = ""


def items(
    folder: Path,
    reading: Mapping[str, Any],
    sources: Path | None,
    source_reading: Mapping[str, Any],
) -> list[Item]:
    """The motions below a folder, in the order of their names.

    What a batch wrote is known from its manifest: robot, source, piece. Of a motion that it wrote
    in several formats, the files that it made last are taken. Of other motions the source is the
    file of `sources` with the same name, before `_on_TARGET`; or `sources` itself, where that is a
    file. Raises `FileFormatError` where there is no motion.
    """
    found: dict[Path, Item] = {}
    written: set[Path] = set()
    for manifest in sorted({path.parent for path in folder.rglob("manifest*.jsonl")}):
        results = _results(manifest)
        written |= results.keys()
        made_last = {_motion_of(entry): entry["finished"] for entry in _by_time(results.values())}
        for path, entry in results.items():
            if entry["finished"] == made_last[_motion_of(entry)]:
                name = path.relative_to(folder).as_posix()
                robot = {"robot": entry["target"]} if is_robot(entry["target"]) else {}
                known = {**robot, **reading}
                found[path] = Item(path, name, known, _origin_of(entry, manifest), entry["target"])
    by_name = _by_name(sources)
    for path in _motions(folder, "robot" in reading):
        if path in written:
            continue
        below = path.relative_to(folder)
        origin = sources if sources is not None and sources.is_file() else None
        for stem in (below.stem, below.stem.partition("_on_")[0]):
            origin = origin or by_name.get(below.with_name(stem))
        known_origin = None if origin is None else _part_of(origin, source_reading, path)
        found[path] = Item(path, below.as_posix(), reading, known_origin)
    if not found:
        raise FileFormatError(
            folder, None, "holds no motion; expected one or more (a robot's needs --robot)"
        )
    return sorted(found.values(), key=lambda item: item.name)


def _results(folder: Path) -> dict[Path, Entry]:
    """What a batch wrote into a folder and is still there."""
    entries = (entry for entry in Manifest(folder) if entry["status"] == "written")
    paths = {folder / str(entry["output"]): entry for entry in entries}
    return {path: entry for path, entry in paths.items() if path.exists()}


def _by_time(entries: Iterable[Entry]) -> list[Entry]:
    return sorted(entries, key=lambda entry: str(entry["finished"]))


def _motion_of(entry: Entry) -> str:
    """What the jobs of one motion have in common that write it in several formats: the name of the
    result, without the ending."""
    ending = FORMATS[entry["options"]["format"] or "npz"] if is_robot(entry["target"]) else ".bvh"
    return str(entry["job"]).removesuffix(ending)


def _motions(folder: Path, robot: bool) -> Iterator[Path]:
    """Motions of characters and, where their files or the user say which, of robots."""
    try:
        paths = motion_files(folder, ENDINGS)
    except FileFormatError:
        return
    for path in paths:
        ending = path.suffix.lower()
        if ending not in SUFFIXES or robot or (ending == ".npz" and _says_robot(path)):
            yield path


def _says_robot(path: Path) -> bool:
    try:
        return "about" in npz_names(path)
    except (FileFormatError, OSError):
        return False


def _origin_of(entry: Entry, folder: Path) -> Origin | None:
    options = entry["options"]
    from_here = os.path.normpath(folder / entry["source_from_here"])
    places = (Path(from_here), Path(entry["source"]))
    path = next((place for place in places if place.is_file()), None)
    if path is None:
        return None
    return Origin(path, options["reading"], entry["start_s"], options["mirrored"])


def _part_of(source: Path, reading: Mapping[str, Any], path: Path) -> Origin:
    """The part of a source that the motion at `path` says it was made from, where it names that
    source; or else all of it."""
    found = made_from(path)
    if found is None or found.part is None or not found.is_of(source):
        return Origin(source, reading)
    return Origin(source, reading, found.part[0])


def _by_name(sources: Path | None) -> dict[Path, Path]:
    if sources is None or not sources.is_dir():
        return {}
    return {path.relative_to(sources).with_suffix(""): path for path in motion_files(sources)}
