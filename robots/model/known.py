"""Robots by name or path, each understood once, however many motions are read or made on it."""

from functools import lru_cache
from pathlib import Path

from robots import registry
from robots.model.mjcf_source import read_source
from robots.model.morphology import Morphology
from robots.model.understand import understand_robot


def known(robot: str | Path) -> Morphology:
    """The robot of a name or an MJCF. Raises `SparkSimError` where none is called that, or where
    its model does not compile, has no legs, or can't stand in a T-pose."""
    path = registry.find(robot)
    return _understood(path, model_sha256(path))


def model_sha256(path: Path) -> str:
    """Of the MJCF and the files that it includes; not of meshes, which move nothing."""
    return read_source(path).sha256


@lru_cache(maxsize=16)
def _understood(path: Path, sha256: str) -> Morphology:
    return understand_robot(path)
