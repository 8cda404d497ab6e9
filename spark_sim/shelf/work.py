"""One job of a batch: read, retarget, measure, and write under a name that is not yet the final
one. It runs in a process of its own, and what it yields is plain data."""

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from robots.formats import written_files
from sim.report import assess
from sim.trajectory import Subject
from spark.errors import SparkSimError, unforeseen
from spark.io.convention import Convention
from spark.io.encoding import encode_new
from spark.io.recording import Recording
from spark.rig.mirror import mirrored
from spark_sim.api import retarget
from spark_sim.clips import AnyClip, Clip, RobotClip
from spark_sim.loading import load, takes
from spark_sim.shelf.cut import pieces
from spark_sim.shelf.fingerprint import fingerprint
from spark_sim.shelf.headline import headline
from spark_sim.shelf.made_of import facts_of, file_facts, robot_facts
from spark_sim.shelf.plan import Job


@dataclass(frozen=True)
class Piece:
    """A result: its `name` and its files, relative to the folder that they were written to, and
    what the manifest says of it."""

    name: Path
    files: tuple[Path, ...]
    facts: Mapping[str, Any]


@dataclass(frozen=True)
class Done:
    """What became of a job: its pieces, or else the error. `source` has the facts of its file."""

    pieces: tuple[Piece, ...]
    source: Mapping[str, Any]
    seconds: float
    error: str | None = None


def work(job: Job, folder: Path) -> Done:
    """Do a job; what it writes lies in `folder`. Whatever fails becomes an error in words."""
    start, facts = time.perf_counter(), {}
    try:
        facts = _of_source(facts_of(job.source))
        clip = _source(
            job.source, job.source.stat().st_mtime_ns, tuple(job.options.reading.items())
        )
        facts |= _of_source(robot_facts(job.source, clip))
        made = tuple(_pieces(job, clip, folder))
        return Done(made, facts, time.perf_counter() - start)
    except (SparkSimError, OSError) as error:
        reason = str(error)
    except Exception as error:  # a fault of ours in one file must not end the others
        reason = unforeseen(error)
    return Done((), facts, time.perf_counter() - start, reason)


def _of_source(facts: Mapping[str, Any]) -> dict[str, Any]:
    return {f"source_{name}": value for name, value in facts.items()}


def _pieces(job: Job, original: AnyClip, folder: Path) -> Iterator[Piece]:
    options = job.options
    source = original if options.fps is None else original.resampled(options.fps)
    if job.mirrored:
        original, source = mirror_clip(original), mirror_clip(source)
    result = retarget(source, target_clip(job.target), method=options.method)
    spans = [(0, len(source))]
    if options.cut is not None:
        spans = pieces(source.motion, source.rig, options.cut)
    several = len(spans) > 1
    for number, (first, stop) in enumerate(spans, 1):
        piece, begin = result, first * source.frame_time
        if several:
            piece = result.part(begin, (stop - 1) * source.frame_time)
        folder.mkdir(parents=True, exist_ok=True)
        path = folder / _name(job, number if several else None)
        files: tuple[Path, ...] = (path,)
        if isinstance(piece, RobotClip):
            replace(piece, path=job.source).save(path, force=True, format=options.format)
            files = written_files(path, options.format)
        else:
            piece.save(path, force=True)
        measured = assess(piece.subject, source=stretch(original, begin, piece.duration))
        facts = {
            **{f"output_{name}": value for name, value in file_facts(files).items()},
            "frames": len(piece),
            "fps": piece.fps,
            "duration_s": piece.duration,
            "start_s": begin,
            "report": headline(measured),
            "notes": list(dict.fromkeys((*source.notes, *piece.notes))),
            "fingerprint": fingerprint(source.motion.frames(first, stop), source.rig),
        }
        yield Piece(Path(path.name), tuple(file.relative_to(folder) for file in files), facts)


def _name(job: Job, number: int | None) -> str:
    """The name of a piece: `walk_cut02.npz` of `walk.npz`."""
    cut = "" if number is None else f"_cut{number:02}"
    return f"{job.output.stem}{cut}{job.output.suffix}"


def stretch(clip: AnyClip, start: float, duration: float) -> Subject:
    """What a clip shows for some seconds from `start` [s] on, on the body as the whole clip shows
    it; all of it where that is as long."""
    motion, body = clip.motion, clip.subject.body
    first = round(start / motion.frame_time)
    stop = first + round(duration / motion.frame_time) + 1
    if start == 0 and duration > motion.duration - 2 * motion.frame_time:
        stop = len(motion)
    if body is not None:
        body = replace(body, qpos=body.qpos[first:stop])
    return replace(clip.subject, motion=motion.frames(first, stop), body=body)


def mirror_clip(clip: AnyClip) -> Clip:
    """A source with left and right exchanged, on the body that a mirror shows."""
    motion, rig = mirrored(clip.motion, clip.rig)
    if isinstance(clip, Clip):
        recording = clip.recording
    else:
        recording = Recording(encode_new(clip.motion), motion, Convention(1.0, "z"), clip.notes)
    notes = (*recording.notes, "left and right are exchanged")
    return Clip(replace(recording, motion=motion, notes=notes), clip.name, None, rig)


@lru_cache(maxsize=1)
def _source(path: Path, changed: int, reading: tuple[tuple[str, Any], ...]) -> AnyClip:
    """The clip of a file as it was when it last `changed`, read once for all targets in a row."""
    return load(path, **{name: value for name, value in reading if name in takes(path)})


@lru_cache(maxsize=16)
def target_clip(target: str | Path) -> AnyClip:
    """The body of a target, understood once a process."""
    return load(target)
