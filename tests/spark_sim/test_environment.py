"""Odd surroundings: terminals without our letters, names of files that are no text, no home."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import spark_sim


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere names of files are text")
def test_ascii_terminals_and_names_that_are_no_text(tmp_path: Path) -> None:
    spark_sim.sample(tmp_path)
    name = os.fsdecode(b"\xff\xe9walk.bvh")
    (tmp_path / "walker_walk.bvh").rename(tmp_path / name)
    ascii_only = {
        **{key: value for key, value in os.environ.items() if key not in ("HOME", "PYTHONUTF8")},
        "LC_ALL": "C",
        "PYTHONIOENCODING": "ascii",
        "PYTHONCOERCECLOCALE": "0",
    }
    done = subprocess.run(
        [sys.executable, "-m", "spark_sim", "inspect", name],
        cwd=tmp_path,
        env=ascii_only,
        capture_output=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert b"walk" in done.stdout
    assert b"\\u2019" in done.stdout or b"\\xb0" in done.stdout  # a degree sign, in ASCII
