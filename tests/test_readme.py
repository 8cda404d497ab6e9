"""The README's commands and Python run as they stand, in the order in which they stand."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

CHECKOUT = Path(__file__).parents[1]
README = (CHECKOUT / "README.md").read_text()


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


def test_commands_and_python_run(tmp_path: Path) -> None:
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    assert len(lines) >= 10
    program = f"{shlex.quote(sys.executable)} -m spark_sim"
    script = [line.replace("spark-sim", program, 1) for line in lines]
    assert all(line.startswith("spark-sim ") for line in lines)
    environment = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    done = subprocess.run(
        ["bash", "-e", "-c", "\n".join(script)],
        cwd=tmp_path,
        env=environment | {"PYTHONPATH": str(CHECKOUT)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    for name in ("out.html", "squat.mp4", "squat.png", "dancer_walk_scene.xml", "report.json"):
        assert (tmp_path / name).stat().st_size > 500
    assert len(list((tmp_path / "many").iterdir())) == 6

    (python,) = blocks("python")
    subprocess.run(
        [sys.executable, "-c", python],
        cwd=tmp_path,
        env=environment | {"PYTHONPATH": str(CHECKOUT)},
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
