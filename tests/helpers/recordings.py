"""The recordings beside the checkout."""

from pathlib import Path
from typing import Any

import pytest

DATA = Path(__file__).parents[3] / "shared" / "data"


def recordings(*patterns: str) -> list[Any]:
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
