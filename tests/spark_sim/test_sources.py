"""Which files of a folder `retarget` and `batch` read, and what they say of the others."""

import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import spark_sim
from spark.errors import FileFormatError
from spark_sim.clips import RobotClip
from spark_sim.sources import find_motions, sentences
from tests.helpers.program import Program


@pytest.fixture(scope="module")
def motions(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A walk, and the same on Ember: as our npz, as mjlab's, as a CSV that says its robot and one
    that doesn't; and what is no motion."""
    folder, samples = (tmp_path_factory.mktemp(name) for name in ("motions", "samples"))
    spark_sim.sample(samples)
    shutil.copy(samples / "walker_walk.bvh", folder / "walk.bvh")
    moved = spark_sim.retarget(folder / "walk.bvh", "robot", method="copy").part(0.0, 0.5)
    assert isinstance(moved, RobotClip)
    moved.save(folder / "ours.npz")
    moved.save(folder / "mjlab.npz", format="mjlab")
    moved.save(folder / "told.csv")
    moved.save(folder / "untold.csv")
    (folder / "untold.csv.json").unlink()
    (folder / "broken.npz").write_bytes(b"no archive")
    (folder / "broken.pkl").write_bytes(b"no pickle")
    np.save(folder / "image.npy", np.zeros((4, 4, 3)))
    (folder / "skeleton.asf").write_text("# read with its AMCs")
    (folder / "notes.txt").write_text("no motion")
    return folder


@pytest.fixture
def program(motions: Path, tmp_path: Path) -> Iterator[Program]:
    shutil.copytree(motions, tmp_path / "in")
    with Program(tmp_path) as program:
        yield program


def test_a_robot_s_motion_that_names_its_robot_is_one_to_read(motions: Path) -> None:
    found = find_motions(motions, robot=False)
    assert [path.name for path in found.motions] == ["ours.npz", "told.csv", "walk.bvh"]
    assert {path.name: reason for path, reason in found.left_out} == {
        **dict.fromkeys(
            ("broken.pkl", "mjlab.npz", "untold.csv"),
            "a robot's motion that names no robot: --robot does",
        ),
        "broken.npz": "can't be read",
        "image.npy": "holds no motion that is known",
    }


def test_with_a_robot_given_all_that_may_be_its_own_is_read(motions: Path) -> None:
    found = find_motions(motions, robot=True)
    assert {path.name for path, _ in found.left_out} == {"image.npy"}
    assert {"mjlab.npz", "untold.csv"} <= {path.name for path in found.motions}


def test_each_kind_is_said_in_one_line_with_its_number(motions: Path) -> None:
    said = list(sentences(find_motions(motions, robot=False).left_out))
    assert len(said) == 3
    (whose,) = [sentence for sentence in said if "--robot" in sentence]
    assert whose.startswith("3 files left out")
    assert all(name in whose for name in ("broken.pkl", "mjlab.npz", "untold.csv"))


def test_a_batch_says_what_it_leaves_out(program: Program) -> None:
    done = program("batch", "in", "--to", "robot", "-o", "out", "--method", "copy")
    assert done.code == 0, done.stderr
    assert "out: 3 written; 5 files left out" in done.stdout
    assert "note: 1 file left out (can't be read): in/broken.npz" in done.stderr
    done = program("batch", "in", "--to", "robot", "-o", "out", "--method", "copy", "--json")
    told = {Path(each["file"]).name for each in json.loads(done.stdout)["no_sources"]}
    assert told == {"broken.npz", "broken.pkl", "image.npy", "mjlab.npz", "untold.csv"}


def test_retarget_says_what_it_leaves_out_and_reads_no_result(
    program: Program, tmp_path: Path
) -> None:
    """Written among its sources, too: the same line again does the same again."""
    line = ("retarget", "in", "--to", "robot", "-o", "in/", "--method", "copy")
    done = program(*line)
    assert done.code == 0, done.stderr
    assert "3 files left out" in done.stderr
    made = {name for name in os.listdir(tmp_path / "in") if "_on_robot" in name}
    assert made == {"ours_on_robot.npz", "told_on_robot.npz", "walk_on_robot.npz"}
    done = program(*line, "--force")
    assert done.code == 0, done.stderr
    assert {name for name in os.listdir(tmp_path / "in") if "_on_robot" in name} == made


@pytest.mark.parametrize("command", ["batch", "retarget"])
def test_a_folder_of_such_files_alone_is_refused_with_the_reason(
    command: str, program: Program, tmp_path: Path
) -> None:
    (tmp_path / "few").mkdir()
    shutil.copy(tmp_path / "in" / "untold.csv", tmp_path / "few")
    done = program(command, "few", "--to", "robot", "-o", "out/")
    assert done.code == 2
    assert "few: holds no motion to read" in done.stderr
    assert "--robot does): few/untold.csv" in done.stderr


def test_a_folder_without_such_files_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match="expected one or more"):
        find_motions(tmp_path, robot=False)
