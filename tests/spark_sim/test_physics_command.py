"""`spark-sim play --physics`: balanced, unless something else holds the body or nothing should."""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import spark_sim
from tests.helpers.program import Program

PLAY = ["play", "walk.npz", "--physics", "--json"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A fifth of a second of a walk, on Ember."""
    folder = tmp_path_factory.mktemp("physics")
    spark_sim.sample(folder)
    walked = spark_sim.retarget(folder / "walker_walk.bvh", "robot", method="copy")
    walked.part(0.0, 0.2).save(folder / "walk.npz")
    return folder


@pytest.fixture(scope="module")
def program(folder: Path) -> Iterator[Program]:
    with Program(folder) as program:
        yield program


@pytest.mark.parametrize(
    ("arguments", "balanced", "verdict"),
    [
        ([], True, "stays_up"),
        (["--no-balance"], False, "stays_up"),
        (["--assist"], False, "carried"),
    ],
)
def test_a_body_is_balanced_by_itself(
    program: Program, arguments: list[str], balanced: bool, verdict: str
) -> None:
    done = program(*PLAY, *arguments)
    assert done.code == 0, done.stderr
    found = json.loads(done.stdout)
    assert (found["balanced"], found["verdict"]) == (balanced, verdict)
    assert found["taken_back_s"] == []


def test_python_balances_likewise(folder: Path) -> None:
    reached: list[int] = []
    found = spark_sim.simulate(folder / "walk.npz", progress=reached.append)
    assert found.tracked.balanced
    assert reached == list(range(1, found.json()["frames"]))
    again = spark_sim.simulate(folder / "walk.npz")
    np.testing.assert_array_equal(found.tracked.body.qpos, again.tracked.body.qpos)


def test_without_a_display_the_report_is_the_result(program: Program) -> None:
    """As in CI and on servers; without --physics there is nothing but the window."""
    done = program("play", "walk.npz", "--physics", "--no-balance")
    assert done.code == 0, done.stderr
    assert "stays up" in done.stdout
    assert "note: there is no display" in done.stderr
    assert "--html" in done.stderr
    assert program("play", "walk.npz").code == 2
