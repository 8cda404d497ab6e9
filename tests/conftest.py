"""Fixtures that tests of several packages share."""

from pathlib import Path

import pytest

import sim  # noqa: F401  (it chooses how MuJoCo draws before a test imports MuJoCo)
import spark_sim


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sample motions as downloads lie: a folder a character."""
    folder = tmp_path_factory.mktemp("downloads")
    for path in spark_sim.sample(folder):
        body, motion = path.stem.split("_", 1)
        (folder / body).mkdir(exist_ok=True)
        path.rename(folder / body / f"{motion}.bvh")
    return folder
