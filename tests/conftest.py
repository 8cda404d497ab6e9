"""What the tests share: the recordings beside the checkout."""

from pathlib import Path

import pytest

import sim  # noqa: F401  (it chooses how MuJoCo draws before a test imports MuJoCo)
import spark_sim

DATA = Path(__file__).parents[2] / "shared" / "data"


def recordings(*patterns: str) -> list[object]:
    """Parameters for `pytest.mark.parametrize`: the files of `DATA` that match, one test each.

    Without the folder there is one parameter, skipped, that names what is missing.
    """
    if not DATA.exists():
        missing = pytest.mark.skip(reason=f"{', '.join(patterns)}: no recordings beside checkout")
        return [pytest.param(DATA, id="no-recordings", marks=missing)]
    files = sorted(path for pattern in patterns for path in DATA.glob(pattern))
    assert files, f"no file of {DATA} matches {patterns}"
    return [pytest.param(path, id=f"{path.parent.name}/{path.stem}") for path in files]


def recording(name: str) -> Path:
    """The file `name` of `DATA`, e.g. "zoo/m2m_fox.bvh"; skips the test by name without it."""
    if not DATA.exists():
        pytest.skip(f"{name}: no recordings beside the checkout")
    return DATA / name


@pytest.fixture(scope="module")
def tree(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sample motions as downloads lie: a folder a character."""
    folder = tmp_path_factory.mktemp("downloads")
    for path in spark_sim.sample(folder):
        body, motion = path.stem.split("_", 1)
        (folder / body).mkdir(exist_ok=True)
        path.rename(folder / body / f"{motion}.bvh")
    return folder
