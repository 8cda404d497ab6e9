"""A current folder from a stranger: beside the motions lie modules named as Python's own."""

import subprocess
import sys
from pathlib import Path

import pytest

import spark_sim
from tests.helpers.program import environment

NAMES = ("multiprocessing", "signal", "socket", "json", "numpy", "spark", "sim", "mujoco", "ctypes")
COMMANDS = (
    "batch . --to robot --method copy -o out --workers 2",
    "report . --html out.html --workers 1",
    "prepare . -o dataset --workers 1",
    "play walker_walk.bvh --strip out.png",
)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    here = tmp_path / "theirs"
    here.mkdir()
    spark_sim.sample(tmp_path / "made")
    for name in ("walker_walk.bvh", "dancer_wave.bvh"):
        (here / name).write_bytes((tmp_path / "made" / name).read_bytes())
    for name in NAMES:
        (here / f"{name}.py").write_text(f"open('ran', 'a').write('{name} ')\n")
    return here


@pytest.mark.parametrize("line", COMMANDS)
def test_nothing_of_the_folder_runs(line: str, folder: Path) -> None:
    """As the installed program starts: Python's path begins with the folder of its script."""
    script = folder.parent / "spark-sim"
    script.write_text(
        "from spark_sim.__main__ import main\n"
        "if __name__ == '__main__':\n"
        "    raise SystemExit(main())\n"
    )
    done = subprocess.run(
        [sys.executable, script, *line.split()],
        cwd=folder,
        env=environment(),
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert not (folder / "ran").exists(), (folder / "ran").read_text()
    assert done.returncode == 0, done.stderr
