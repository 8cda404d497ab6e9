"""Robots by name or path, each understood once, however many motions are read or made on it."""

import hashlib
import re
from functools import lru_cache
from pathlib import Path

from robots import registry
from robots.model.morphology import Morphology
from robots.model.understand import understand_robot

_INCLUDE = re.compile(rb"<include\s+file\s*=\s*[\"']([^\"']+)")


def known(robot: str | Path) -> Morphology:
    """The robot of a name or an MJCF. Raises `SparkSimError` where none is called that, or where
    its model does not compile, has no legs, or can't stand in a T-pose."""
    path = registry.find(robot)
    return _understood(path, model_sha256(path))


def model_sha256(path: Path) -> str:
    """Of the MJCF and the files that it includes; not of meshes, which move nothing."""
    return hashlib.sha256(b"".join(_with_included(path, set()))).hexdigest()


@lru_cache(maxsize=16)
def _understood(path: Path, sha256: str) -> Morphology:
    return understand_robot(path)


def _with_included(path: Path, seen: set[Path]) -> list[bytes]:
    if path in seen or not path.is_file():
        return []
    seen.add(path)
    text = path.read_bytes()
    included = [path.parent / name.decode(errors="replace") for name in _INCLUDE.findall(text)]
    return [text, *(part for file in included for part in _with_included(file, seen))]
