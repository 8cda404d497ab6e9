"""Odd surroundings: terminals without our letters, names of files that are no text, no home."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import spark_sim

CHECKOUT = Path(__file__).parents[2]


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


_RUN = """
import mujoco  # before spark_sim, and so before it chooses how to draw without a display
import json, os, sys, tempfile
tempfile.tempdir = os.getcwd()  # what is left without /tmp
from spark_sim.cli import run
for line in sys.stdin:
    print(run(json.loads(line)), file=sys.stderr, flush=True)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere names of files are text")
@pytest.mark.parametrize("home", [None, "/proc"])  # in /proc nobody may write, root neither
def test_every_kind_of_output_in_poor_surroundings(tmp_path: Path, home: str | None) -> None:
    """No home or one that is read-only, no folder for temporary files, no display, one core, names
    of 250 bytes that are no text, MuJoCo loaded first; two pages with pictures in one process."""
    spark_sim.sample(tmp_path)
    stem = os.fsdecode(b"\xff\xe9" + 240 * b"w")
    (tmp_path / "walker_walk.bvh").rename(tmp_path / f"{stem}.bvh")
    source, target = f"{stem}.bvh", "dancer_wave.bvh"
    (tmp_path / "takes").mkdir()
    shutil.copy(tmp_path / source, tmp_path / "takes")
    shutil.copy(tmp_path / target, tmp_path / "takes")
    gone = ["DISPLAY", "WAYLAND_DISPLAY", "HOME", "MUJOCO_GL", "PYOPENGL_PLATFORM", "PYTHONUTF8"]
    gone += ["XDG_CACHE_HOME"]
    kept = {key: value for key, value in os.environ.items() if key not in gone}
    poor = {"LC_ALL": "C"} if home is None else {"LC_ALL": "C", "HOME": home}
    lines = [
        ["inspect", source, "--save-map", f"{stem}.toml"],
        ["retarget", source, "--to", target, "-o", f"{stem}o.bvh"],
        ["retarget", source, "--to", "robot", "--method", "copy", "-o", f"{stem}.npz"],
        ["report", f"{stem}o.bvh", "--source", source, "--html", f"{stem}r.html"],
        ["report", target, "--html", "again.html"],
        ["play", f"{stem}.npz", "--html", f"{stem}.html"],
        ["retarget", target, "--to", source, "-o", f"{stem}.glb"],
        ["mjcf", target, "-o", "body.xml"],
        ["batch", "takes", "--to", target, "-o", "out", "--workers", "1"],
        ["report", "out", "--workers", "1"],
        ["prepare", "takes", "-o", "dataset", "--workers", "1"],
        ["retarget", source, "--to", target],  # the name that it would get is too long
    ]
    done = subprocess.run(
        [sys.executable, "-c", _RUN],
        input="\n".join(map(json.dumps, lines)).encode(),
        cwd=tmp_path,
        env=kept
        | poor
        | {"PYTHONPATH": str(CHECKOUT), "PYTHONIOENCODING": "ascii:backslashreplace"},
        preexec_fn=lambda: os.sched_setaffinity(0, {min(os.sched_getaffinity(0))}),
        capture_output=True,
        timeout=300,
    )
    codes = [int(line) for line in done.stderr.splitlines() if line.strip().isdigit()]
    assert codes == [*[0] * 11, 2], done.stderr.replace(240 * b"w", b"w")
    assert b"File name too long" in done.stderr
    assert (tmp_path / "dataset" / "index.json").is_file()
    for path in (f"{stem}o.bvh", f"{stem}.npz", f"{stem}r.html", "again.html", f"{stem}.html"):
        assert (tmp_path / path).stat().st_size > 1000
    assert not list(tmp_path.glob(".spark-sim*"))
