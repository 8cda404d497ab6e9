"""The README's commands and Python run as they stand, in the order in which they stand."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

from tests.helpers.program import Program

CHECKOUT = Path(__file__).parents[1]
README = (CHECKOUT / "README.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


def test_commands_and_python_run(tmp_path: Path) -> None:
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    assert len(lines) >= 10
    assert all(line.startswith("spark-sim ") for line in lines)
    with Program(tmp_path) as spark_sim:
        for line in lines:
            _, *words = shlex.split(line, comments=True)
            words, file = (words[:-2], words[-1]) if ">" in words else (words, None)
            done = spark_sim(*words)
            assert done.code == 0, f"{line}\n{done.stderr}"
            if file:
                (tmp_path / file).write_text(done.stdout)
    for name in ("out.html", "squat.mp4", "squat.png", "dancer_walk_scene.xml", "report.json"):
        assert (tmp_path / name).stat().st_size > 500
    assert len(list((tmp_path / "many").iterdir())) == 6

    (python,) = blocks("python")
    subprocess.run(
        [sys.executable, "-c", python],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(CHECKOUT)},
        capture_output=True,
        check=True,
    )
    assert (tmp_path / "walk.html").exists()


def test_make_targets_exist() -> None:
    targets = set(re.findall(r"^    make (\w+)", README, re.MULTILINE))
    assert targets == {"demo", "test"}
    makefile = (CHECKOUT / "Makefile").read_text()
    assert targets < set(re.findall(r"^(\w+):", makefile, re.MULTILINE))


def test_links_and_pictures_exist() -> None:
    places = re.findall(r"\]\(([^)]+)\)", README)
    assert "docs/images/strip.png" in places
    for place in places:
        assert (CHECKOUT / place).exists(), place
    assert (CHECKOUT / "docs" / "images" / "strip.png").stat().st_size < 150_000
