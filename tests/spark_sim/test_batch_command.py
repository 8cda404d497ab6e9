"""`spark-sim batch` as a user meets it."""

import json
import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import spark_sim
from spark.files import alone
from tests.helpers.gltf import animated
from tests.helpers.program import CHECKOUT, Program
from tests.helpers.rigs import RIGS, build, walk


@pytest.fixture
def shelf(samples: Path, tmp_path: Path) -> Path:
    """A folder with `in/` of two motions in two folders, a broken one, and a target."""
    (tmp_path / "in" / "sub").mkdir(parents=True)
    shutil.copy(samples / "walker_squat.bvh", tmp_path / "in")
    shutil.copy(samples / "walker_wave.bvh", tmp_path / "in" / "sub")
    shutil.copy(samples / "dancer_walk.bvh", tmp_path / "mutant.bvh")
    (tmp_path / "in" / "broken.bvh").write_text("no BVH")
    return tmp_path


@pytest.fixture
def program(shelf: Path) -> Iterator[Program]:
    with Program(shelf) as program:
        yield program


def lines(out: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (out / "manifest.jsonl").read_text().splitlines()]


@pytest.mark.parametrize("option", ["--jobs", "-j"])
def test_workers_are_found_by_the_name_that_others_have(option: str, program: Program) -> None:
    done = program("batch", "in", "--to", "robot", "-o", "out", option, "4")
    assert f"no option is called {option}; did you mean --workers?" in done.stderr
    assert "--workers" not in program("inspect", "mutant.bvh", option, "4").stderr


def test_a_shelf_onto_two_bodies(shelf: Path, program: Program) -> None:
    """Files as `retarget` writes them, a line for each, and one bad file that stops nothing."""
    arguments = ("batch", "in", "--to", "robot", "--to", "mutant.bvh", "-o", "out")
    done = program(*arguments, "--workers", "2")
    assert done.code == 2
    assert done.stderr.count("broken.bvh:1: ") == 2
    *_, last = done.stdout.splitlines()
    assert last.startswith("out: 4 written, 2 failed: in/broken.bvh: ")
    found = {p.relative_to(shelf / "out").as_posix() for p in (shelf / "out").rglob("walker_*")}
    assert found == {
        *("robot/walker_squat.npz", "robot/sub/walker_wave.npz"),
        *("mutant/walker_squat.bvh", "mutant/sub/walker_wave.bvh"),
    }
    assert program("retarget", "in/walker_squat.bvh", "--to", "robot", "-o", "alone.npz").code == 0
    alone = (shelf / "alone.npz").read_bytes()
    assert alone == (shelf / "out" / "robot" / "walker_squat.npz").read_bytes()

    entries = {entry["job"]: entry for entry in lines(shelf / "out")}
    assert len(entries) == 6
    report = program("report", "alone.npz", "--source", "in/walker_squat.bvh", "--json")
    headline = entries["robot/walker_squat.npz"]["report"]
    assert isinstance(headline, dict)
    assert headline["implausible_share"] == json.loads(report.stdout)["implausible_share"]
    assert entries["robot/broken.npz"]["status"] == "failed"

    again = program(*arguments)
    assert again.stdout.startswith("out: 4 unchanged, 2 failed: ")


def test_mirrored_motions_come_with_the_others(shelf: Path, program: Program) -> None:
    """The robot's squat is as good in the mirror: its left knee bends as the right one did."""
    (shelf / "in" / "broken.bvh").unlink()
    done = program("batch", "in/sub", "--to", "robot", "-o", "out", "--mirror", "--workers", "1")
    assert done.code == 0, done.stderr
    one, other = (np.load(path) for path in sorted((shelf / "out" / "robot").iterdir()))
    names = one["joint_names"].tolist()
    left, right = names.index("left_elbow"), names.index("right_elbow")
    waves = [np.ptp(take["qpos"][:, 7:], axis=0) for take in (one, other)]
    assert max(waves[0][[left, right]]) > 2 * min(waves[0][[left, right]])
    assert waves[0][left] == pytest.approx(waves[1][right], abs=0.05)
    assert waves[0][right] == pytest.approx(waves[1][left], abs=0.05)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (("--to", "no_such_robot"), "no robot is called 'no_such_robot'"),
        (("--to", "robot", "--keep", "speed < 3"), "no measure is called 'speed'"),
        (("--to", "robot", "--shard", "9/8"), "'9/8' is no share"),
        (("--to", "mutant.bvh", "--format", "mjlab"), "is a character"),
        (("--to", "robot", "--workers", "0"), "expected 1 or more"),
    ],
)
def test_mistakes_are_told_before_the_work(
    shelf: Path, program: Program, options: tuple[str, ...], says: str
) -> None:
    done = program("batch", "in", *options, "-o", "out")
    assert done.code == 2
    assert says in done.stderr
    assert not list((shelf / "out").rglob("*.npz"))


def test_one_run_at_a_time(shelf: Path, program: Program) -> None:
    with alone(shelf / "out"):
        done = program("batch", "in", "--to", "robot", "-o", "out")
    assert done.code == 2
    assert "another run is writing to it" in done.stderr


def test_shares_are_the_whole(shelf: Path, program: Program) -> None:
    arguments = ("batch", "in", "--to", "robot", "-o", "out", "--method", "copy", "--workers", "1")
    for share in ("1/2", "2/2"):
        program(*arguments, "--shard", share)
    assert len(list((shelf / "out").rglob("*.npz"))) == 2
    done = program(*arguments)
    assert done.stdout.startswith("out: 2 unchanged, 1 failed")


def test_killed_its_processes_end_and_a_second_run_goes_on(shelf: Path, program: Program) -> None:
    arguments = ("batch", "in", "--to", "robot", "--method", "copy", "--workers", "2")
    process = subprocess.Popen(
        [sys.executable, "-m", "spark_sim", *arguments, "-o", "out"],
        cwd=shelf,
        env=os.environ | {"PYTHONPATH": str(CHECKOUT)},
        stderr=subprocess.DEVNULL,
    )
    children: set[int] = set()
    while process.poll() is None and not list((shelf / "out").glob("robot/*.npz")):
        children |= children_of(process.pid)
        time.sleep(0.01)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert children
    deadline = time.monotonic() + 60
    while left := {pid for pid in children if Path(f"/proc/{pid}").exists()}:
        assert time.monotonic() < deadline, left
        time.sleep(0.05)
    done = program(*arguments, "-o", "out")
    assert "1 failed" in done.stdout
    assert not list((shelf / "out").glob(".part*"))
    program(*arguments, "-o", "whole")
    for path in (shelf / "whole" / "robot").rglob("*.npz"):
        other = shelf / "out" / path.relative_to(shelf / "whole")
        assert other.read_bytes() == path.read_bytes()


def children_of(pid: int) -> set[int]:
    try:
        text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    except OSError:
        return set()
    return set(map(int, text.split()))


@pytest.mark.parametrize("format", ["mjlab", "csv", "sonic"])
def test_pieces_at_another_rate_in_any_format(shelf: Path, program: Program, format: str) -> None:
    """Together the pieces are as long as the motion; each is read again on its robot, and the
    report of the folder finds robot and source of each in the manifest."""
    arguments = (
        *("batch", "mutant.bvh", "--to", "robot", "-o", "out", "--method", "copy"),
        *("--format", format, "--fps", "50", "--cut", "2s", "--workers", "1"),
        *(("--mirror",) if format == "csv" else ()),
    )
    done = program(*arguments)
    assert done.code == 0, done.stderr
    assert program(*arguments).stdout == f"out: {done.stdout.split()[1]} unchanged\n"
    source = spark_sim.load(shelf / "mutant.bvh")
    pieces = [e for e in lines(shelf / "out") if not e["options"]["mirrored"]]
    assert len(pieces) == 2
    for piece, following in pairwise(pieces):
        assert piece["duration_s"] <= 2.0
        assert piece["start_s"] + piece["duration_s"] == pytest.approx(
            following["start_s"], abs=1.5 * (source.frame_time + 0.02)
        )
    last = pieces[-1]
    assert last["start_s"] + last["duration_s"] == pytest.approx(source.duration, abs=0.03)
    clip = spark_sim.load(shelf / "out" / last["output"], robot="robot")
    assert clip.fps == pytest.approx(50)
    assert len(clip) == last["frames"]

    if format != "csv":
        return
    done = program("report", "out", "--workers", "1")
    assert done.code == 0, done.stderr
    rows = {
        row["file"]: row for row in json.loads((shelf / "out/report.json").read_text())["clips"]
    }
    assert len(rows) == len(lines(shelf / "out"))
    for entry in lines(shelf / "out"):
        row = rows[entry["output"]]
        assert Path(row["source"]).name == "mutant.bvh"
        for name in ("implausible_share", "root_drift_m", "invented_contact_share"):
            assert row[name] == pytest.approx(entry["report"][name], abs=1e-4), name


def test_a_changed_file_beside_a_source_or_a_target_is_noticed(
    shelf: Path, program: Program
) -> None:
    """The buffers of a glTF lie beside it; the file itself stays as it is."""
    for folder in ("mocap", "body"):
        (shelf / folder).mkdir()
        gltf = animated(walk(*build(RIGS["mixamo"])))
        gltf.write(shelf / folder / "walk.gltf", buffer="beside")
    arguments = ("batch", "mocap", "--to", "body/walk.gltf", "-o", "out", "--method", "copy")
    assert program(*arguments).stdout == "out: 1 written\n"
    assert program(*arguments).stdout == "out: 1 unchanged\n"
    assert program("report", "out").code == 0
    page = shelf / "out" / "report_clips" / "walk" / "walk.bvh.html"
    for folder in ("mocap", "body"):
        before = page.stat().st_mtime_ns
        buffer = shelf / folder / "keys of it.bin"
        buffer.write_bytes(buffer.read_bytes() + bytes(4))
        assert program(*arguments).stdout == "out: 1 written\n", folder
        assert program(*arguments).stdout == "out: 1 unchanged\n", folder
        assert program("report", "out").code == 0
        # The result is the same, and was made of another source, or onto the same body.
        assert (page.stat().st_mtime_ns != before) == (folder == "mocap")


def test_near_duplicates_are_named(shelf: Path, program: Program) -> None:
    shutil.copy(shelf / "in" / "walker_squat.bvh", shelf / "in" / "again.bvh")
    (shelf / "in" / "broken.bvh").unlink()
    done = program("batch", "in", "--to", "robot", "-o", "out", "--method", "copy")
    assert done.code == 0
    assert "nearly the same motion: in/again.bvh, in/walker_squat.bvh" in done.stderr
    assert done.stderr.count("nearly the same") == 1
