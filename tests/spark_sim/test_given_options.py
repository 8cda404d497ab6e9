"""Options that go with none of the files that they are for: an error, and nothing is written."""

from collections.abc import Iterator
from pathlib import Path

import pytest

import spark_sim
from tests.helpers.program import Program

WALK, OTHER = "walker_walk.bvh", "dancer_wave.bvh"
OF_A_ROBOT = "--robot robot", "--quat xyzw", "--clip idle", "--body-model body.npz"
"""What goes with no BVH."""
# The last option of each is refused, and the error names it.
LINES = [
    *(f"inspect {WALK} {option}" for option in OF_A_ROBOT),
    *(f"report {WALK} {option}" for option in OF_A_ROBOT),
    *(f"report {WALK} --source {OTHER} --source-{option[2:]}" for option in OF_A_ROBOT),
    *(f"play {WALK} --html out.html {option}" for option in OF_A_ROBOT),
    *(f"retarget {WALK} --to {OTHER} -o out.bvh {option}" for option in OF_A_ROBOT),
    *(f"batch {WALK} --to {OTHER} -o out {option}" for option in OF_A_ROBOT),
    "report takes --html out.html --quat xyzw",
    f"report takes --html out.html --source {WALK} --source-quat xyzw",
    f"mjcf {WALK} -o out.xml --body-model body.npz",
    f"retarget {WALK} --to robot -o out.npz --to-unit cm",
    f"retarget {WALK} --to {OTHER} -o out.bvh --to-clip idle",
    "inspect walk.npz --unit cm",
    "inspect walk.npz --fps 30",
    f"report {WALK} --truth {OTHER} --quat xyzw",
    # Of a file that is not given.
    f"report {WALK} --source-unit cm",
    f"report {WALK} --source-robot robot",
    "play --serve --unit cm",
    # Of another way of the same command.
    f"report {WALK} --workers 2",
    f"play {WALK} --serve --same-height",
    f"play {WALK} --serve --mesh {WALK}",
    f"play {WALK} --serve --speed 2",
    f"play {WALK} --strip out.png --speed 2",
    "live --to robot --recover session.npz.part",
    f"live --from {WALK} --recover session.npz.part",
    f"live --from {WALK} --address localhost:80 --send vmc://127.0.0.1:39999",
    f"batch {WALK} --to {OTHER} -o out --backend ray --workers 2",
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("given")
    spark_sim.sample(folder)
    spark_sim.retarget(folder / WALK, "robot", refine=False).save(folder / "walk.npz")
    (folder / "takes").mkdir()
    (folder / "takes" / WALK).write_bytes((folder / WALK).read_bytes())
    return folder


@pytest.fixture(scope="module")
def program(folder: Path) -> Iterator[Program]:
    with Program(folder) as program:
        yield program


@pytest.mark.parametrize("line", LINES)
def test_an_option_that_goes_with_no_file_is_an_error(
    line: str, folder: Path, program: Program
) -> None:
    before = set(folder.rglob("*"))
    done = program(*line.split())
    assert done.code == 2
    option = [word for word in line.split() if word.startswith("--")][-1]
    assert option in done.stderr.splitlines()[-1]
    assert set(folder.rglob("*")) == before


def test_an_option_is_left_out_for_some_files_and_said(program: Program) -> None:
    done = program("inspect", WALK, "walk.npz", "--robot", "robot", "--unit", "cm")
    assert done.code == 0
    assert f"--robot is left out for '{WALK}', which it does not go with" in done.stderr
    assert "--unit is left out for 'walk.npz', which it does not go with" in done.stderr


def test_options_go_with_files_that_they_are_for(program: Program) -> None:
    """The twin of the errors."""
    assert program("inspect", "walk.npz", "--robot", "robot").code == 0
    assert program("inspect", WALK, "--unit", "cm", "--up", "y", "--fps", "30").code == 0
