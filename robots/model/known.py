"""Robots by name or path, each understood once, however many motions are read or made on it."""

import hashlib
from functools import lru_cache
from pathlib import Path

from robots import registry
from robots.model import model_cache
from robots.model.mjcf_source import MjcfSource, read_source
from robots.model.morphology import Morphology
from robots.model.understand import understand_robot


def known(robot: str | Path) -> Morphology:
    """The robot of a name or an MJCF. Raises `SparkSimError` where none is called that, or where
    its model does not compile, has no legs, or can't stand in a T-pose."""
    path = registry.find(robot)
    return _understood(path, model_sha256(path))


def model_sha256(path: Path) -> str:
    """Of the MJCF and the files that it includes; not of meshes, which move nothing."""
    at = _sources.get(path)
    if at is None or at[1] != _stamps(at[0].files):
        source = read_source(path)
        at = _sources[path] = source, _stamps(source.files)
    return at[0].sha256


def shape_sha256(robot: str | Path) -> str:
    """Of all that a robot is understood from: its MJCF, what that includes, and the meshes that
    collide. Raises what `known` raises."""
    path = registry.find(robot)
    return _shape_sha256(path, model_sha256(path))


_sources: dict[Path, tuple[MjcfSource, list[tuple[int, ...]]]] = {}
"""Models that were read, and when their files had last changed."""


def _stamps(files: tuple[Path, ...]) -> list[tuple[int, ...]]:
    """What changes with a file; nothing of one that is gone."""
    stats = [path.stat() for path in files if path.exists()]
    return [(s.st_ino, s.st_size, s.st_mtime_ns, s.st_ctime_ns) for s in stats]


@lru_cache(maxsize=16)
def _shape_sha256(path: Path, sha256: str) -> str:
    mjcf, digest = _understood(path, sha256).mjcf, hashlib.sha256(sha256.encode())
    for _, content in model_cache.assets(mjcf.spec):
        if content is None:  # of a model that this one attaches, which has folders of its own
            content = mjcf.model.mesh_vert.tobytes()
        digest.update(hashlib.sha256(content).digest())
    return digest.hexdigest()


@lru_cache(maxsize=16)
def _understood(path: Path, sha256: str) -> Morphology:
    return understand_robot(path)
