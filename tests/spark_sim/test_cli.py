"""The command line as a user meets it: a subprocess, its output, its exit code."""

import json
import os
import pty
import re
import signal
import subprocess
import sys
import termios
from collections.abc import Iterator, Sequence
from pathlib import Path

import mujoco
import pytest

import spark_sim
from spark_sim import cli
from tests.helpers.program import Program, command, environment
from tests.helpers.skins import write_character

GOLDENS = Path(__file__).parent / "goldens"
COMMANDS = (
    *("retarget", "batch", "robots", "inspect", "report", "play", "mjcf", "sample"),
    *("prepare", "train", "evaluate", "export"),
)
WALK, TARGET = "walker_walk.bvh", "dancer_wave.bvh"
RESULT = "walker_walk_on_dancer_wave.bvh"


def run(*args: object, cwd: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        command(*args), cwd=cwd, env=environment(), capture_output=True, text=True, timeout=120
    )


def good(*args: object, cwd: Path) -> str:
    """The standard output of a command that must succeed."""
    done = run(*args, cwd=cwd)
    assert done.returncode == 0, done.stderr
    return done.stdout


def bad(*args: object, cwd: Path) -> str:
    """The error of a command that must fail as users' mistakes do: in words, with exit code 2."""
    done = run(*args, cwd=cwd)
    assert done.returncode == 2, done.stderr
    return error_of(done.stderr)


def error_of(stderr: str) -> str:
    """What is said beside notes: a mistake, in words."""
    errors = [line for line in stderr.splitlines() if "spark-sim: note:" not in line]
    assert errors[0].startswith("spark-sim: error: ")
    assert "Traceback" not in stderr
    return "\n".join([*errors, ""])


def on_terminal(args: Sequence[object], cwd: Path, stream: str, **extra: str) -> str:
    """What a command writes to `stream`, stdout or stderr, when that is a terminal."""
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 80))
    streams = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL} | {stream: theirs}
    process = subprocess.Popen(command(*args), cwd=cwd, env=environment(**extra), **streams)
    os.close(theirs)
    received = b""
    try:
        while chunk := os.read(ours, 4096):
            received += chunk
    except OSError:  # how Linux says that the other end is closed
        pass
    os.close(ours)
    assert process.wait(120) == 0
    return received.decode()


def golden(name: str, text: str) -> None:
    """Compare with the text under `tests/spark_sim/goldens`; UPDATE_GOLDENS=1 writes it."""
    path = GOLDENS / f"{name}.txt"
    if os.environ.get("UPDATE_GOLDENS"):
        path.write_text(text)
    assert text == path.read_text()


@pytest.fixture
def here(tmp_path: Path, samples: Path) -> Path:
    """A folder with a source and a target."""
    for name in (WALK, TARGET):
        (tmp_path / name).write_bytes((samples / name).read_bytes())
    return tmp_path


@pytest.fixture(scope="module")
def erring(samples: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    """The program among files that are none, in one process for all mistakes: none writes."""
    here = tmp_path_factory.mktemp("erring")
    for name in (WALK, TARGET):
        (here / name).write_bytes((samples / name).read_bytes())
    (here / "empty.bvh").touch()
    (here / "empty").mkdir()
    (here / "broken.toml").write_text('pelvis = "mixamorig:Hips"\nhead = \n')
    (here / "role.toml").write_text('\ntail = "mixamorig:Hips"\n')
    (here / "joint.toml").write_text('head = "mixamorig:Hed"\n')
    (here / "twice.toml").write_text('head = "mixamorig:Head"\nneck = ["mixamorig:Head"]\n')
    (here / "snake.bvh").write_text(SNAKE)
    before = {path.name for path in here.iterdir()}
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", "80")
        with Program(here) as program:
            yield program
    assert {path.name for path in here.iterdir()} == before


@pytest.mark.parametrize("name", ["", *COMMANDS])
def test_help(name: str, tmp_path: Path) -> None:
    text = good(*name.split(), "--help", cwd=tmp_path)
    golden(f"help_{name or 'all'}", text)
    assert max(map(len, text.splitlines())) < 80


def test_help_loads_nothing_heavy(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-X", "importtime", *command("retarget", "--help")[1:]],
        cwd=tmp_path,
        env=environment(),
        capture_output=True,
        text=True,
    )
    loaded = set(re.findall(r"\| +([\w.]+)$", done.stderr, re.MULTILINE))
    assert "argparse" in loaded
    assert not loaded & {"numpy", "scipy", "mujoco", "torch", "jaxtyping", "tqdm", "spark.motion"}


def test_retarget_loads_neither_torch_nor_mujoco(here: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-X", "importtime", *command("retarget", WALK, "--to", TARGET)[1:]],
        cwd=here,
        env=environment(),
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0
    loaded = set(re.findall(r"\| +([\w.]+)$", done.stderr, re.MULTILINE))
    assert "numpy" in loaded
    assert not loaded & {"torch", "mujoco", "tqdm"}


def test_no_command_prints_help(tmp_path: Path) -> None:
    done = run(cwd=tmp_path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == (GOLDENS / "help_all.txt").read_text()


def test_version(tmp_path: Path) -> None:
    assert good("--version", cwd=tmp_path) == f"spark-sim {spark_sim.__version__}\n"


@pytest.mark.parametrize("code", ["DISTRIBUTION = 'other'", "raise RuntimeError('no')"])
def test_foreign_package_named_sim(code: str, tmp_path: Path) -> None:
    """Run from a folder that has a `sim` of its own, which comes before the installed packages."""
    (tmp_path / "sim").mkdir()
    (tmp_path / "sim" / "__init__.py").write_text(code)
    error = bad("--help", cwd=tmp_path)
    assert error.startswith("spark-sim: error: the package 'sim' ")
    assert ("RuntimeError: no" if "raise" in code else str(tmp_path / "sim")) in error


def test_sample(tmp_path: Path) -> None:
    written = good("sample", "motions", cwd=tmp_path).split()
    assert sorted(written) == sorted(f"motions/{p.name}" for p in (tmp_path / "motions").iterdir())
    assert "motions/walker_walk.bvh" in bad("sample", "motions", cwd=tmp_path)


def test_retarget(here: Path) -> None:
    done = run("retarget", WALK, "--to", TARGET, cwd=here)
    assert done.returncode == 0
    assert re.fullmatch(
        rf"{RESULT}: \d+ frames, 30 fps, 22 -> 22 joints, scaled by 0\.98\n", done.stdout
    )
    assert [line.split(" unit ")[0] for line in done.stderr.splitlines()] == [
        f"spark-sim: note: {TARGET}:",
        f"spark-sim: note: {WALK}:",
    ]
    walk, result, target = (spark_sim.load(here / name) for name in (WALK, RESULT, TARGET))
    assert len(result.motion) == len(walk.motion)
    assert result.motion.frame_time == pytest.approx(walk.motion.frame_time, abs=1e-6)
    assert result.recording.bvh.joints == target.recording.bvh.joints


def test_retarget_does_not_overwrite(here: Path) -> None:
    (here / "out.bvh").write_text("precious")
    args = ("retarget", WALK, "--to", TARGET, "-o", "out.bvh")
    golden("error_exists", bad(*args, cwd=here))
    assert (here / "out.bvh").read_text() == "precious"
    good(*args, "--force", cwd=here)
    assert (here / "out.bvh").read_text().startswith("HIERARCHY")


def test_retarget_many(here: Path) -> None:
    """A folder keeps its tree, and one bad file does not stop the others."""
    takes = here / "takes" / "day1"
    takes.mkdir(parents=True)
    (takes / "a.bvh").write_bytes((here / WALK).read_bytes())
    (takes / "B.BVH").write_bytes((here / WALK).read_bytes())
    (takes / "broken.bvh").write_text("HIERARCHY\n")
    (takes / "notes.txt").write_text("not a motion")
    done = run("retarget", "takes", WALK, "--to", TARGET, "-o", "out", "--json", cwd=here)
    assert done.returncode == 2
    results = [json.loads(line) for line in done.stdout.splitlines()]
    day1 = Path("out/day1")
    assert {r["output"] for r in results} == {
        str(day1 / "a_on_dancer_wave.bvh"),
        str(day1 / "B_on_dancer_wave.bvh"),
        str(Path("out") / RESULT),
        None,
    }
    assert all((here / r["output"]).exists() for r in results if r["output"])
    failed = next(r for r in results if not r["output"])
    assert failed["error"].startswith("takes/day1/broken.bvh:")
    assert "spark-sim: error: takes/day1/broken.bvh:" in done.stderr
    assert done.stderr.endswith("spark-sim: error: 1 of 4 motions could not be retargeted\n")


def test_retarget_refuses_two_results_of_one_name(here: Path) -> None:
    (here / "b").mkdir()
    (here / "b" / WALK).write_bytes((here / WALK).read_bytes())
    error = bad("retarget", WALK, f"b/{WALK}", "--to", TARGET, cwd=here)
    assert f"would both be written to {RESULT}" in error
    assert not (here / RESULT).exists()


def test_corrections_are_believed(here: Path) -> None:
    """A unit that is given counts, for the source and for the target."""
    args = ("retarget", WALK, "--to", TARGET, "--json")
    usual = json.loads(good(*args, "-o", "1.bvh", cwd=here))
    small = json.loads(good(*args, "-o", "2.bvh", "--unit", "mm", cwd=here))
    large = json.loads(good(*args, "-o", "3.bvh", "--to-unit", "2.0", cwd=here))
    assert small["scale"] == pytest.approx(10 * usual["scale"])
    assert large["scale"] == pytest.approx(2 * usual["scale"])


@pytest.mark.parametrize(
    ("name", "args"),
    [
        ("target_xml", ("retarget", WALK, "--to", "g1.xml")),
        ("source_fbx", ("retarget", "kaya.fbx", "--to", TARGET)),
        ("source_missing", ("retarget", "nowhere.bvh", "--to", TARGET)),
        ("source_empty", ("inspect", "empty.bvh")),
        ("folder_empty", ("retarget", "empty/", "--to", TARGET)),
        ("output_is_folder", ("mjcf", WALK, "-o", "empty")),
        ("output_below_file", ("retarget", WALK, "--to", TARGET, "-o", f"{WALK}/out.bvh")),
        ("outputs_in_file", ("retarget", WALK, TARGET, "--to", TARGET, "-o", WALK)),
        ("unit", ("inspect", WALK, "--unit", "furlong")),
        ("up", ("inspect", WALK, "--up", "w")),
        ("map_missing", ("inspect", WALK, "--map", "nowhere.toml")),
        ("map_toml", ("inspect", WALK, "--map", "broken.toml")),
        ("map_role", ("inspect", WALK, "--map", "role.toml")),
        ("map_joint", ("inspect", WALK, "--map", "joint.toml")),
        ("map_twice", ("inspect", WALK, "--map", "twice.toml")),
        ("no_display", ("play", WALK)),
        ("no_target", ("retarget", WALK)),
        ("file_unset", ("inspect", WALK, "")),
        ("target_unset", ("retarget", WALK, "--to", "")),
        ("output_unset", ("retarget", WALK, "--to", TARGET, "-o", "")),
        ("option_typo", ("retarget", WALK, "--too", TARGET)),
        ("command_typo", ("retraget", WALK, "--to", TARGET)),
        ("two_files_to", ("retarget", WALK, "--to", TARGET, WALK)),
        ("folder", ("inspect", "empty")),
        ("two_targets", ("retarget", WALK, "--to", TARGET, "--to", "robot")),
        ("fbx_is_not_written", ("retarget", WALK, "--to", TARGET, "-o", "samba.fbx")),
        ("no_ending", ("retarget", WALK, "--to", TARGET, "-o", "out")),
        ("robot_as_bvh", ("retarget", WALK, "--to", "robot", "-o", "walk.bvh")),
        ("map_ending", ("inspect", WALK, "--save-map", TARGET, "--force")),
        ("fail_over", ("report", WALK, "--fail-over", "most")),
        ("snake", ("report", "snake.bvh")),
    ],
)
def test_errors(name: str, args: tuple[str, ...], erring: Program) -> None:
    done = erring(*args)
    assert done.code == 2, done.stderr
    golden(f"error_{name}", error_of(done.stderr))


SNAKE = """\
HIERARCHY
ROOT a
{
  OFFSET 0 0 0
  CHANNELS 3 Xposition Yposition Zposition
  JOINT b
  {
    OFFSET 0 1 0
    CHANNELS 3 Zrotation Xrotation Yrotation
    End Site
    {
      OFFSET 0 1 0
    }
  }
}
MOTION
Frames: 1
Frame Time: 0.1
0 0 0 0 0 0
"""


def test_inspect(here: Path) -> None:
    facts = json.loads(good("inspect", WALK, "--json", cwd=here))
    assert (facts["unit"], facts["up"], facts["fps"]) == ("cm", "y", pytest.approx(30))
    roles = {joint["joint"]: joint["role"] for joint in facts["body"]["joints"]}
    assert roles["mixamorig:Hips"] == "pelvis"
    assert roles["mixamorig:LeftForeArm"] == "left_forearm"
    text = good("inspect", WALK, cwd=here)
    assert re.search(r"left_forearm +mixamorig:LeftForeArm +\d+%", text)


def test_inspect_of_what_is_no_humanoid(tmp_path: Path) -> None:
    (tmp_path / "snake.bvh").write_text(SNAKE)
    facts = json.loads(good("inspect", "snake.bvh", "--json", cwd=tmp_path))
    assert facts["joints"] == 2
    assert facts["body"] is None
    assert "not a humanoid" in facts["refused"]
    assert facts["refused"] in good("inspect", "snake.bvh", "--save-map", "s.toml", cwd=tmp_path)
    form = (tmp_path / "s.toml").read_text()
    assert "\n# pelvis = []\n" in form
    assert '\n#   "b"\n' in form


def test_map_is_saved_edited_and_given_back(here: Path) -> None:
    good("inspect", TARGET, "--save-map", "map.toml", cwd=here)
    saved = (here / "map.toml").read_text()
    assert 'left_hand = "DEF-hand.L"' in saved
    before = json.loads(good("inspect", TARGET, "--json", cwd=here))
    unchanged = json.loads(good("inspect", TARGET, "--json", "--map", "map.toml", cwd=here))
    given = [(joint["joint"], joint["role"]) for joint in unchanged["body"]["joints"]]
    assert given == [(joint["joint"], joint["role"]) for joint in before["body"]["joints"]]
    edited = saved.replace('left_hand = "DEF-hand.L"', "left_hand = []")
    (here / "map.toml").write_text(edited)
    facts = json.loads(good("inspect", TARGET, "--json", "--map", "map.toml", cwd=here))
    roles = {joint["joint"]: joint["role"] for joint in facts["body"]["joints"]}
    assert roles["DEF-hand.L"] is None
    good("retarget", WALK, "--to", TARGET, "--to-map", "map.toml", cwd=here)


def test_mjcf(here: Path) -> None:
    assert good("mjcf", WALK, cwd=here) == "walker_walk.xml\nwalker_walk_scene.xml\n"
    model = mujoco.MjModel.from_xml_path(str(here / "walker_walk_scene.xml"))
    assert model.nbody == 1 + 22  # the world and the rig's joints
    assert model.geom_group.max() <= 2  # viewers hide the groups above
    assert "walker_walk.xml: exists" in bad("mjcf", WALK, cwd=here)


def test_play_writes_page_and_picture(here: Path) -> None:
    stdout = good("play", WALK, TARGET, "--html", "a.html", "--strip", "a.png", cwd=here)
    assert [line.split(":")[0] for line in stdout.splitlines()] == ["a.html", "a.png"]
    assert (here / "a.html").read_text().lstrip().lower().startswith("<!doctype html>")
    assert (here / "a.png").read_bytes().startswith(b"\x89PNG")


def test_report(here: Path) -> None:
    report = json.loads(good("report", WALK, "--json", cwd=here))
    assert isinstance(report, dict)
    assert "implausible" in good("report", WALK, "--source", WALK, cwd=here)


def test_report_as_a_page_and_beside_others(here: Path) -> None:
    args = ("report", WALK, "--source", WALK, "--html", "out/report.html")
    good(*args, cwd=here)
    assert "of the frames are implausible" in (here / "out/report.html").read_text()
    assert "exists" in bad(*args, cwd=here)
    good(*args, "--force", cwd=here)
    table = good("report", WALK, "--compare", TARGET, "--source", WALK, cwd=here).splitlines()
    assert table[0].split() == [Path(WALK).stem, Path(TARGET).stem]
    both = json.loads(good("report", WALK, "--compare", TARGET, "--json", cwd=here))
    assert set(both) == {WALK, TARGET}


@pytest.mark.parametrize(("limit", "code"), [("0%", 1), ("100", 0)])
def test_fail_over(limit: str, code: int, here: Path) -> None:
    """Half of the frames are put 30 cm under the floor."""
    text = (here / WALK).read_text().splitlines()
    first = next(i for i, line in enumerate(text) if line.startswith("Frame Time")) + 1
    for i in range(first, first + (len(text) - first) // 2):
        x, y, z, rest = text[i].split(maxsplit=3)
        text[i] = f"{x} {float(y) - 30} {z} {rest}"
    (here / "sunk.bvh").write_text("\n".join([*text, ""]))
    args = ("report", "sunk.bvh", "--source", WALK, "--fail-over", limit)
    done = run(*args, cwd=here)
    assert done.returncode == code
    assert ("--fail-over allows 0 %" in done.stderr) == (code == 1)


def test_progress_and_color_are_for_terminals(here: Path) -> None:
    (here / "takes").mkdir()
    for k in range(20):  # they take seconds: progress is shown after half of one
        (here / "takes" / f"{k}.bvh").symlink_to(here / WALK)
    args = ["retarget", "takes", "--to", TARGET, "-o", "out", "--force"]
    assert "retarget:" in on_terminal(args, here, "stderr")
    assert "retarget:" not in run(*args, cwd=here).stderr
    report = ["report", WALK]
    assert "\x1b[" in on_terminal(report, here, "stdout")
    assert "\x1b[" not in on_terminal(report, here, "stdout", NO_COLOR="1")
    assert "\x1b[" not in good(*report, cwd=here)


def test_interrupting_an_import_is_quiet(monkeypatch: pytest.MonkeyPatch) -> None:
    """Extension modules make an ImportError of Ctrl-C; one of another cause is a fault."""
    said: list[str] = []
    monkeypatch.setattr("spark_sim.console.error", said.append)
    for cause, expected in ((KeyboardInterrupt(), 130), (ValueError(), 70)):

        def fail(args: object, cause: BaseException = cause) -> int:
            raise ImportError("initialization failed") from cause

        monkeypatch.setattr("spark_sim.commands.sample.run", fail)
        said.clear()
        assert cli.run(["sample"]) == expected
        assert len(said) == (expected == 70)


def test_interrupt_is_quiet(here: Path) -> None:
    (here / "takes").mkdir()
    for k in range(200):
        (here / "takes" / f"{k}.bvh").symlink_to(here / WALK)
    process = subprocess.Popen(
        command("retarget", "takes", "--to", TARGET, "-o", "out"),
        cwd=here,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    process.stdout.readline()
    process.send_signal(signal.SIGINT)
    _, stderr = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in stderr
    assert "error" not in stderr
    assert 0 < len(list((here / "out").glob("*.bvh"))) < 200
    assert not list((here / "out").glob(".*"))


def test_closed_pipe_is_quiet(here: Path) -> None:
    process = subprocess.Popen(
        command("inspect", WALK),
        cwd=here,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    stderr = process.stderr.read()
    process.stderr.close()
    assert process.wait(60) == 141
    assert "Traceback" not in stderr
    assert "BrokenPipe" not in stderr


@pytest.mark.parametrize("wanted", [False, True])
def test_faults_of_our_own_ask_to_be_reported(wanted: bool, tmp_path: Path) -> None:
    script = (
        "import sys, spark_sim.cli as cli, spark_sim.commands.sample as sample\n"
        "def fail(args): raise ZeroDivisionError('what a pity')\n"
        "sample.run = fail\n"
        "sys.exit(cli.run(['sample']))\n"
    )
    extra = {"SPARK_SIM_TRACEBACK": "1"} if wanted else {}
    done = subprocess.run(
        [sys.executable, "-c", script],
        cwd=tmp_path,
        env=environment(**extra),
        capture_output=True,
        text=True,
    )
    assert ("Traceback" in done.stderr) == wanted
    assert "ZeroDivisionError: what a pity" in done.stderr
    if not wanted:
        assert done.returncode == 70
        assert "Please report it" in done.stderr


def test_play_with_the_skin_of_a_file(here: Path) -> None:
    walk = spark_sim.load(here / WALK).part(0.0, 0.5)
    write_character(walk.motion, here / "body.glb")
    done = run("play", WALK, TARGET, "--mesh", "body.glb", "--strip", "mesh.png", cwd=here)
    assert done.returncode == 0
    assert "walker_walk.bvh: wears the skin of body" in done.stderr
    assert "dancer" not in "".join(line for line in done.stderr.splitlines() if "wears" in line)
    alone = run("play", TARGET, "--mesh", "body.glb", "--strip", "alone.png", cwd=here)
    assert "wears the skin of body; scaled by" in alone.stderr
    written = good("retarget", TARGET, "--to", "body.glb", "-o", "worn.glb", cwd=here)
    assert "worn.glb" in written
    good("play", "worn.glb", "--strip", "worn.png", cwd=here)
    plain, worn = ((here / name).read_bytes() for name in ("alone.png", "worn.png"))
    assert plain.startswith(b"\x89PNG")
    assert worn.startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("mesh", "words"),
    [
        (WALK, "has no skin"),
        ("ember", "a robot has no skin"),
        ("none.glb", "no such file"),
    ],
)
def test_a_mesh_that_is_none_is_refused(mesh: str, words: str, here: Path) -> None:
    assert words in bad("play", WALK, "--mesh", mesh, "--strip", "x.png", cwd=here)
    assert not (here / "x.png").exists()


def test_a_result_never_overwrites_what_it_is_made_from(here: Path) -> None:
    for source, target, out in ((WALK, TARGET, WALK), (WALK, TARGET, TARGET), (WALK, WALK, WALK)):
        before = (here / out).read_bytes()
        error = bad("retarget", source, "--to", target, "-o", out, "--force", cwd=here)
        assert "what the result is made from" in error
        assert (here / out).read_bytes() == before
