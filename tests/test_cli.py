"""The command line as a user meets it: a subprocess, its output, its exit code."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

GOLDENS = Path(__file__).parent / "goldens"
CHECKOUT = Path(__file__).parents[1]
COMMANDS = ("retarget", "inspect", "report", "play", "mjcf", "sample")


def environment(**extra: str) -> dict[str, str]:
    """This process's environment, without a display and with a terminal of 80 columns."""
    dropped = ("DISPLAY", "WAYLAND_DISPLAY", "SPARK_SIM_TRACEBACK", "NO_COLOR")
    kept = {name: value for name, value in os.environ.items() if name not in dropped}
    return kept | {"COLUMNS": "80", "PYTHONPATH": str(CHECKOUT)} | extra


def spark_sim(*args: object, cwd: Path, **extra: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "spark_sim", *map(str, args)],
        cwd=cwd,
        env=environment(**extra),
        capture_output=True,
        text=True,
        timeout=120,
    )


def good(*args: object, cwd: Path) -> str:
    """The standard output of a command that must succeed."""
    done = spark_sim(*args, cwd=cwd)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout


def golden(name: str, text: str) -> None:
    """Compare with the text under `tests/goldens`; UPDATE_GOLDENS=1 writes it."""
    path = GOLDENS / f"{name}.txt"
    if os.environ.get("UPDATE_GOLDENS"):
        path.write_text(text)
    assert text == path.read_text()


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_help(command: str, tmp_path: Path) -> None:
    text = good(*command.split(), "--help", cwd=tmp_path)
    golden(f"help_{command or 'all'}", text)
    assert max(map(len, text.splitlines())) < 80


def test_help_loads_nothing_heavy(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "spark_sim", "retarget", "--help"],
        cwd=tmp_path,
        env=environment(),
        capture_output=True,
        text=True,
    )
    loaded = set(re.findall(r"\| +([\w.]+)$", done.stderr, re.MULTILINE))
    assert "argparse" in loaded
    assert not loaded & {"numpy", "scipy", "mujoco", "torch", "jaxtyping", "tqdm", "spark.motion"}


def test_no_command_prints_help(tmp_path: Path) -> None:
    done = spark_sim(cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (GOLDENS / "help_all.txt").read_text()


def test_version(tmp_path: Path) -> None:
    assert re.fullmatch(r"spark-sim \d+\.\d+\.\d+\S*\n", good("--version", cwd=tmp_path))


@pytest.mark.parametrize("code", ["DISTRIBUTION = 'other'", "raise RuntimeError('no')"])
def test_foreign_package_named_sim(code: str, tmp_path: Path) -> None:
    """Run from a folder that has a `sim` of its own, which comes before the installed packages."""
    (tmp_path / "sim").mkdir()
    (tmp_path / "sim" / "__init__.py").write_text(code)
    done = spark_sim("--help", cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.startswith("spark-sim: error: the package 'sim' ")
    assert ("RuntimeError: no" if "raise" in code else str(tmp_path / "sim")) in done.stderr
    assert "Traceback" not in done.stderr
