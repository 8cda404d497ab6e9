"""What becomes of the ground that a result states: it is kept in a cut, judged on, and drawn."""

from pathlib import Path

import numpy as np
import pytest

import spark_sim
from sim.view.staging import build_scene
from spark_sim.cli import run
from spark_sim.clips import RobotClip

KERB = (
    '<mujoco><worldbody><geom type="box" size="0.6 1 0.02" pos="1.4 0 0.02"/></worldbody></mujoco>'
)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A robot's motion over a kerb, and beside it what it was made from."""
    folder = tmp_path_factory.mktemp("kerb")
    spark_sim.sample(folder)
    (folder / "kerb.xml").write_text(KERB)
    source, out = folder / "walker_walk.bvh", folder / "walk.npz"
    told = ["--terrain", str(folder / "kerb.xml"), "-o", str(out)]
    assert run(["retarget", str(source), "--to", "robot", *told]) == 0
    return out


def test_a_report_is_by_the_ground_that_the_file_has(made: Path) -> None:
    said = spark_sim.report(made, source=made.with_name("walker_walk.bvh")).text()
    assert "the ground is stated" in said
    assert "the source is on it" in said


def test_cuts_and_other_rates_are_on_the_same_ground(made: Path) -> None:
    clip = spark_sim.load(made)
    assert isinstance(clip, RobotClip)
    assert clip.terrain is not None
    for other in (clip.part(0.5, 1.5), clip.resampled(20.0)):
        assert other.terrain is clip.terrain


def test_other_robots_climb_it_for_their_size(made: Path) -> None:
    clip = spark_sim.load(made).part(0.0, 1.0)
    again = spark_sim.retarget(clip, "robot")
    assert isinstance(again, RobotClip)
    assert again.terrain is not None
    assert clip.terrain is not None
    np.testing.assert_allclose(again.terrain.vertices, clip.terrain.vertices, atol=1e-6)


def test_a_page_draws_it(made: Path) -> None:
    (placement,) = build_scene(spark_sim.load(made).figures()).placements
    assert len(placement.ground) == 1
