"""Files that are none, given to every option of every command that reads or writes one: a typed
error, and nothing is written."""

import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

import spark_sim
from tests.helpers.program import Program

WALK = "walker_walk.bvh"
# Where X stands comes the odd file.
READING = [
    "retarget X --to dancer_wave.bvh -o out.bvh",
    "retarget walker_walk.bvh --to X -o out.bvh",
    "retarget walker_walk.bvh --to dancer_wave.bvh --to-map X -o out.bvh",
    "retarget walker_walk.bvh --to dancer_wave.bvh --checkpoint X -o out.bvh",
    "inspect X",
    "inspect walker_walk.bvh --map X",
    "inspect walk.npz --robot X",
    "report X --html out.html",
    "report walker_walk.bvh --source X --html out.html",
    "report walker_walk.bvh --truth X --html out.html",
    "report walker_walk.bvh --compare X --html out.html",
    "play X --html out.html",
    "play walker_walk.bvh --mesh X --html out.html",
    "mjcf X -o out.xml",
    "mjcf walker_walk.bvh --mesh X -o out.xml",
    "batch walker_walk.bvh --to X -o out",
    "live --from X --send vmc://127.0.0.1:39999",
    "live --recover X",
]
ODD_IN = [
    *("pipe", "pipe.npz", "pipe.glb", "pipe.xml", "folder.bvh", "socket.bvh", "circle.bvh"),
    *("nowhere.bvh", "zero.bvh", "zero.npz", "zero.safetensors", "", "~", "-"),
    *("x" * 300 + ".bvh", "n\udc80.bvh", "n\0.bvh"),
]
WRITING = [
    "retarget walker_walk.bvh --to dancer_wave.bvh -o X",
    "retarget walker_walk.bvh --to robot --method copy -o X",
    "inspect walker_walk.bvh --save-map X",
    "inspect walker_walk.bvh --html X",
    "report walker_walk.bvh --html X",
    "report takes --html X --workers 1",
    "play walker_walk.bvh --html X",
    "play walker_walk.bvh --strip X",
    "play walker_walk.bvh --video X",
    "mjcf walker_walk.bvh -o X",
    "batch walker_walk.bvh --to dancer_wave.bvh -o X --workers 1",
    "prepare walker_walk.bvh -o X --workers 1",
    "sample X",
]
ODD_OUT = [
    *("/dev/full", "/proc/out.bvh", "walker_walk.bvh", "walker_walk.bvh/out.bvh", "circle.bvh"),
    *("", "x" * 300, "socket.bvh"),
]
ODD_FILE_OUT = [".", "..", "/", "folder.bvh"]  # where a folder may be written, they may be, too


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("odd")
    spark_sim.sample(folder)
    spark_sim.retarget(folder / WALK, "robot", refine=False).save(folder / "walk.npz")
    for name in ("pipe", "pipe.npz", "pipe.glb", "pipe.xml"):
        os.mkfifo(folder / name)
    (folder / "folder.bvh").mkdir()
    (folder / "takes").mkdir()
    (folder / "takes" / WALK).write_bytes((folder / WALK).read_bytes())
    for name in ("zero.bvh", "zero.npz", "zero.safetensors"):
        (folder / name).symlink_to("/dev/zero")
    (folder / "circle.bvh").symlink_to("circle.bvh")
    before = os.getcwd()
    os.chdir(folder)  # names of sockets are short
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind("socket.bvh")
        os.chdir(before)
        yield folder


@pytest.fixture(scope="module")
def program(folder: Path) -> Iterator[Program]:
    with Program(folder) as program:
        yield program


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")
@pytest.mark.parametrize("line", READING)
def test_what_is_no_file_ends_in_an_error(line: str, folder: Path, program: Program) -> None:
    before = set(folder.iterdir())
    for odd in ODD_IN:
        done = program(*(odd if word == "X" else word for word in line.split()))
        assert done.code == 2, (odd, done)
        assert "spark-sim: error: " in done.stderr, odd
        assert set(folder.iterdir()) <= before, odd


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names")
@pytest.mark.parametrize("line", WRITING)
def test_where_nothing_can_be_written(line: str, folder: Path, program: Program) -> None:
    """Nor does --force help, but to overwrite a motion by a motion."""
    before = {path: path.read_bytes() for path in folder.glob("*.bvh") if path.is_file()}
    folders = line.partition(" ")[0] in ("retarget", "batch", "prepare", "sample")
    for odd in ODD_OUT if folders else ODD_OUT + ODD_FILE_OUT:
        for more in ([], ["--force"]):
            if more and odd in ("/dev/full", "walker_walk.bvh"):
                continue  # a device is written to, and a motion by a motion
            words = [odd if word == "X" else word for word in line.split()]
            done = program(*words, *more)
            assert done.code == 2, (odd, done)
            assert "spark-sim: error: " in done.stderr, odd
            assert {path: path.read_bytes() for path in before} == before, odd
