"""Files that are none, given to every option of every command that reads one: a typed error, and
nothing is written."""

import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest

import spark_sim
from tests.helpers.program import Program

WALK = "walker_walk.bvh"
# Where X stands comes the odd file.
LINES = [
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
ODD = [
    *("pipe", "pipe.npz", "pipe.glb", "pipe.xml", "folder.bvh", "socket.bvh", "circle.bvh"),
    *("nowhere.bvh", "zero.bvh", "zero.npz", "zero.safetensors", "", "~", "-"),
    *("x" * 300 + ".bvh", "n\udc80.bvh", "n\0.bvh"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("odd")
    spark_sim.sample(folder)
    spark_sim.retarget(folder / WALK, "robot", refine=False).save(folder / "walk.npz")
    for name in ("pipe", "pipe.npz", "pipe.glb", "pipe.xml"):
        os.mkfifo(folder / name)
    (folder / "folder.bvh").mkdir()
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
@pytest.mark.parametrize("line", LINES)
def test_what_is_no_file_ends_in_an_error(line: str, folder: Path, program: Program) -> None:
    before = set(folder.iterdir())
    for odd in ODD:
        done = program(*(odd if word == "X" else word for word in line.split()))
        assert done.code == 2, (odd, done)
        assert "spark-sim: error: " in done.stderr, odd
        assert set(folder.iterdir()) <= before, odd
