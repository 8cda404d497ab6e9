"""Shells that closed or filled a stream, that say odd things of the terminal, or whose folder is
gone."""

import subprocess
import sys
from pathlib import Path

import pytest

import spark_sim
from spark.errors import OutputError, lacks_memory
from spark_sim import cli, files
from tests.helpers.program import command, environment

WALK, TARGET = "walker_walk.bvh", "dancer_wave.bvh"


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("shell")
    spark_sim.sample(folder)
    return folder


def in_shell(line: str, here: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    """A line of the shell, in which $@ is `spark-sim` with these words."""
    told = ["bash", "-c", line, "bash", *command(*words)]
    return subprocess.run(
        told, cwd=here, env=environment(), capture_output=True, text=True, timeout=120
    )


@pytest.mark.parametrize("columns", ["wide", "-5", "0", "1e3", "9" * 5000, "\u0663"])
def test_odd_widths_are_80_columns(
    columns: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    helps = []
    for width in ("80", columns):
        monkeypatch.setenv("COLUMNS", width)
        with pytest.raises(SystemExit):
            cli.run(["retarget", "--help"])
        helps.append(capsys.readouterr().out)
    assert helps[0] == helps[1]
    monkeypatch.setenv("COLUMNS", "60")
    with pytest.raises(SystemExit):
        cli.run(["retarget", "--help"])
    assert capsys.readouterr().out != helps[0]


@pytest.mark.skipif(sys.platform == "win32", reason="no bash")
def test_closed_streams_take_nothing_in(here: Path) -> None:
    """What libraries print does not get into the file that would have their number."""
    words = ("retarget", WALK, "--to", TARGET, "--force", "-o")
    assert in_shell('"$@"', here, *words, "open.bvh").returncode == 0
    done = in_shell('"$@" <&- >&- 2>&-', here, *words, "closed.bvh")
    assert done.returncode == 0
    assert (here / "closed.bvh").read_bytes() == (here / "open.bvh").read_bytes()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is full")
def test_notes_that_can_not_be_written_end_nothing(here: Path) -> None:
    done = in_shell('"$@" 2>/dev/full', here, "inspect", WALK)
    assert done.returncode == 0
    assert "mixamorig:Hips" in done.stdout
    assert in_shell('"$@" 2>/dev/full', here, "inspect", "nowhere.bvh").returncode == 2
    full = in_shell('"$@" >/dev/full', here, "inspect", WALK)
    assert full.returncode == 2
    assert "No space left" in full.stderr


@pytest.mark.skipif(sys.platform == "win32", reason="a folder in use can't be deleted")
@pytest.mark.parametrize(
    "words",
    [
        ("batch", f"HERE/{WALK}", "--to", f"HERE/{TARGET}", "-o", "out"),
        ("train", "HERE", "-o", "HERE/run"),
    ],
)
def test_a_folder_that_was_deleted_is_named(here: Path, words: tuple[str, ...]) -> None:
    line = 'mkdir gone && cd gone && rmdir ../gone && "$@"'
    done = in_shell(line, here, *(word.replace("HERE", str(here)) for word in words))
    assert done.returncode == 2
    assert "the current folder, which was deleted" in done.stderr


def test_too_little_memory_is_said(here: Path) -> None:
    script = (
        "import sys, spark_sim.cli as cli, spark_sim.commands.sample as sample\n"
        "def fail(args): raise MemoryError\n"
        "sample.run = fail\n"
        "sys.exit(cli.run(['sample']))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=here, env=environment(), capture_output=True, text=True
    )
    assert done.returncode == 2
    assert (
        done.stderr == "spark-sim: error: this needs more memory, or more threads, than there are\n"
    )


def test_who_says_that_memory_lacks() -> None:
    assert lacks_memory(MemoryError())
    assert lacks_memory(RuntimeError("DefaultCPUAllocator: can't allocate memory: you tried"))
    assert not lacks_memory(ValueError("shape"))


def test_names_do_not_steer_the_terminal(capfd: pytest.CaptureFixture[str]) -> None:
    """Neither hide a line nor turn its direction; the report's own colours stay."""
    hidden = "a\x1b[8mb\x1b[2K\u202ec\x07"
    script = "import sys; from spark_sim import console; console.{}(sys.argv[1])"
    for name, words in (("note", hidden), ("error", hidden), ("say", hidden)):
        subprocess.run([sys.executable, "-c", script.format(name), words], env=environment())
        told = "".join(capfd.readouterr())
        assert "a\\u001b[8mb\\u001b[2K\\u202ec\\u0007" in told
    subprocess.run(
        [sys.executable, "-c", script.format("say"), "\x1b[31mbad\x1b[0m"], env=environment()
    )
    assert capfd.readouterr().out == "\x1b[31mbad\x1b[0m\n"


def test_a_link_whose_folder_is_missing_is_named(tmp_path: Path) -> None:
    link = tmp_path / "out.html"
    link.symlink_to(tmp_path / "nowhere" / "out.html")
    with pytest.raises(OutputError, match=r"leads to .*nowhere.*, and there is no such"):
        files.claim(link, force=True)


def test_a_motion_that_is_given_twice_is_refused(here: Path) -> None:
    words = ("retarget", WALK, TARGET, WALK, "--to", TARGET, "-o", "twice/")
    done = in_shell('"$@"', here, *words)
    assert done.returncode == 2
    assert f"{WALK} is given twice" in done.stderr
    assert not (here / "twice").exists()


def test_a_way_to_draw_that_is_none_is_named(here: Path) -> None:
    told = ["play", WALK, "--html", "out.html"]
    done = subprocess.run(
        command(*told),
        cwd=here,
        env=environment(MUJOCO_GL="crayon"),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 2
    assert "MUJOCO_GL: crayon" in done.stderr
