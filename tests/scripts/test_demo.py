"""What `make demo` shows is what README says of it."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from jaxtyping import Float
from PIL import Image

import spark_sim
from spark.errors import DependencyError

CHECKOUT = Path(__file__).parents[2]
IN_README = CHECKOUT / "docs" / "images" / "strip.png"


def picture(path: Path) -> Float[np.ndarray, "H W 3"]:
    with Image.open(path) as image:
        return np.asarray(image.convert("RGB"), dtype=float)


def test_the_demos_picture_is_readmes(tmp_path: Path) -> None:
    """Left the source, right the target, five moments; drivers differ by an edge's tint."""
    spark_sim.sample(tmp_path)
    walk, target = (tmp_path / f"{name}_walk.bvh" for name in ("walker", "dancer"))
    script = (CHECKOUT / "scripts" / "demo.sh").read_text()
    assert 'retarget "$folder/walker_walk.bvh" --to "$folder/dancer_walk.bvh"' in script
    assert 'play "$folder/walker_walk.bvh" "$result"' in script
    assert "five moments" in (CHECKOUT / "README.md").read_text()
    try:
        spark_sim.play(walk, spark_sim.retarget(walk, target), strip=tmp_path / "walk.png")
    except DependencyError as error:
        pytest.skip(f"nothing can be drawn: {error}")
    shown, expected = picture(tmp_path / "walk.png"), picture(IN_README)
    assert shown.shape == expected.shape
    assert np.abs(shown - expected).mean() < 1.0
    fifth = shown.shape[1] // 5
    moments = [shown[:, n * fifth : (n + 1) * fifth] for n in range(5)]
    for before, after in pairwise(moments):
        assert np.abs(after - before).mean() > 1.0
