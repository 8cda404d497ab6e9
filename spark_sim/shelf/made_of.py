"""What a motion is read from, and whether that is still the same: its file, the files beside it
that are read with it, and the robot that it moves."""

import hashlib
import os
from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

from robots.formats.sidecar import sidecar_of
from robots.model.known import shape_sha256
from robots.registry import is_robot, name_of
from spark.errors import FileFormatError, SparkSimError
from spark.io.companions import companions
from spark_sim.clips import AnyClip, RobotClip

Facts = dict[str, Any]
"""As the manifest has them: `sha256`, `bytes` and `mtime_ns` of a file; `beside`, the same of each
file that is read with it, and its `file` as seen from there; of a robot's motion its `robot`, by
name or from there, and `robot_sha256`."""


def facts_of(path: Path) -> Facts:
    """Of a motion's file, or a folder that is one, and of the files beside it."""
    beside = [
        {"file": os.path.relpath(other, path.parent), **file_facts([other])}
        for other in (*companions(path), sidecar_of(path))
        if other.is_file()
    ]
    return {**file_facts(_files(path)), "beside": beside}


def robot_facts(path: Path, clip: AnyClip) -> Facts:
    """Of the robot that moves in the clip of a file; nothing where a character does."""
    if not isinstance(clip, RobotClip):
        return {}
    model = clip.on_robot.robot.mjcf.path
    robot = name_of(model) or os.path.relpath(model, path.parent)
    return {"robot": robot, "robot_sha256": shape_sha256(model)}


def is_still_made_of(path: Path, facts: Mapping[str, Any]) -> bool:
    """Whether a motion would be read from the same as when these facts were taken."""
    beside = facts.get("beside", ())
    return (
        is_still(_files(path), facts)
        and all(is_still([path.parent / each["file"]], each) for each in beside)
        and ("robot" not in facts or _robot(path, facts["robot"]) == facts["robot_sha256"])
    )


def is_still(paths: Sequence[Path], facts: Mapping[str, Any]) -> bool:
    """Whether files are what the facts say: by size and time, or else by their bytes."""
    try:
        now = file_facts(paths, facts["sha256"])
        return now["bytes"] == facts["bytes"] and (
            now["mtime_ns"] == facts["mtime_ns"] or file_facts(paths)["sha256"] == now["sha256"]
        )
    except OSError:
        return False


def file_facts(paths: Sequence[Path], known_sha256: str | None = None) -> Facts:
    """Size, time and hash of a file; of several the sum, the latest, and the hash of the hashes."""
    stats = [path.stat() for path in paths]
    return {
        "sha256": known_sha256 or _one_of([sha256(path) for path in paths]),
        "bytes": sum(stat.st_size for stat in stats),
        "mtime_ns": max(stat.st_mtime_ns for stat in stats),
    }


def reading_sha256(reading: Mapping[str, Any]) -> dict[str, str]:
    """Of the files and the robot that are given for reading a motion, as `spark_sim.load` takes
    them. Raises `SparkSimError` where one can't be read."""
    hashes = {}
    for name in sorted(reading.keys() & {"roles", "body_model"}):
        path = Path(reading[name])
        try:
            hashes[name] = _known_sha256(path, path.stat().st_mtime_ns)
        except OSError as error:
            raise FileFormatError(path, None, f"can't be read ({error.strerror})") from error
    if "robot" in reading:
        hashes["robot"] = shape_sha256(reading["robot"])
    return hashes


@lru_cache(maxsize=16)  # a body model has hundreds of megabytes, and serves a whole shelf
def _known_sha256(path: Path, changed: int) -> str:
    return sha256(path)


def target_sha256(target: str) -> str:
    """Of all that a target is understood from: a robot's model, or a character's files."""
    if is_robot(target):
        return shape_sha256(target)
    facts = facts_of(Path(target))
    return _one_of([facts["sha256"], *(each["sha256"] for each in facts["beside"])])


def sha256(path: Path) -> str:
    """Of a file's bytes, which are never all in memory."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _files(path: Path) -> list[Path]:
    """The file itself, or the files of a folder that is one motion."""
    return sorted(p for p in path.iterdir() if p.is_file()) if path.is_dir() else [path]


def _robot(path: Path, robot: str) -> str | None:
    """What is now the hash of the robot of a motion's file; None where there is none."""
    try:
        return shape_sha256(path.parent / robot if Path(robot).suffix else robot)
    except (SparkSimError, OSError):
        return None


def _one_of(hashes: Sequence[str]) -> str:
    return hashes[0] if len(hashes) == 1 else hashlib.sha256("".join(hashes).encode()).hexdigest()
