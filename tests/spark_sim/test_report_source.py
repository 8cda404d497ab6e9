"""`spark-sim report --source`: the part of the source, and the right source, as the file says."""

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import pytest

import spark_sim
from tests.helpers.program import Program

PART = ("--start", "1", "--end", "2")


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Program]:
    """The walk and another motion, and on Ember all of the walk and a second of it."""
    mocap, folder = (tmp_path_factory.mktemp(name) for name in ("mocap", "source"))
    spark_sim.sample(mocap)
    shutil.copy(mocap / "walker_walk.bvh", folder / "walk.bvh")
    shutil.copy(mocap / "walker_squat.bvh", folder / "other.bvh")
    (folder / "few").mkdir()
    with Program(folder) as program:
        for name, part in (("part", PART), ("whole", ()), ("few/walk_on_robot", PART)):
            done = program("retarget", "walk.bvh", "--to", "robot", "-o", f"{name}.npz", *part)
            assert done.code == 0, done.stderr
        yield program


def test_a_part_is_measured_against_its_part_of_the_source(program: Program) -> None:
    done = program("report", "part.npz", "--source", "walk.bvh", "--json")
    found = json.loads(done.stdout)
    assert "note: walk.bvh: from 1 to 2 s, the part that part.npz was made from" in done.stderr
    assert not any("duration differs" in note for note in found["notes"])
    assert found["foot_contacts"]["f1"] > 0.9


def test_each_of_several_files_takes_its_own_part(program: Program) -> None:
    done = program("report", "part.npz", "--compare", "whole.npz", "--source", "walk.bvh", "--json")
    assert done.stderr.count("was made from") == 1
    for found in json.loads(done.stdout).values():
        assert not any("duration differs" in note for note in found["notes"])


def test_a_folder_s_motions_take_their_parts(program: Program) -> None:
    done = program("report", "few", "--source", ".", "--json")
    (clip,) = json.loads(done.stdout)["clips"]
    assert not any("duration differs" in note for note in clip["notes"])
    assert clip["missed_contact_share"] < 0.1


def test_another_source_is_noted_and_measured_all_the_same(program: Program) -> None:
    done = program("report", "whole.npz", "--source", "other.bvh")
    assert done.code == 0
    assert "whole.npz: was made from walk.bvh, not from this file: other.bvh" in done.stderr
    assert "was made from" not in program("report", "whole.npz", "--source", "walk.bvh").stderr


def test_a_source_that_is_the_part_already_is_taken_whole(program: Program, tmp_path: Path) -> None:
    spark_sim.sample(tmp_path)
    walk = spark_sim.load(tmp_path / "walker_walk.bvh")
    cut = walk.part(1.0, 2.0).save(tmp_path / "cut.bvh")
    done = program("report", "part.npz", "--source", str(cut), "--json")
    assert "from 1 to 2 s" not in done.stderr
    notes = json.loads(done.stdout)["notes"]
    assert not any("duration differs" in note for note in notes)
