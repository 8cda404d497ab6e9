"""What a motion and a target are read from: a change in any of these files is seen."""

import json
import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import spark_sim
from robots import registry
from robots.formats.sidecar import sidecar_of
from robots.model.known import _shape_sha256, _understood
from spark.errors import SparkSimError
from spark_sim.shelf.made_of import (
    facts_of,
    is_still_made_of,
    reading_sha256,
    robot_facts,
    target_sha256,
)
from spark_sim.shelf.plan import Options
from tests.helpers.gltf import animated
from tests.helpers.rigs import RIGS, build, walk

EMBER = registry.find("robot").read_text()
BLOCK = "v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 {}\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


def amc(folder: Path) -> tuple[Path, Path]:
    (folder / "02.asf").write_text(":version 1.10\n")
    (folder / "02_01.amc").write_text(":FULLY-SPECIFIED\n")
    return folder / "02_01.amc", folder / "02.asf"


def gltf(folder: Path) -> tuple[Path, Path]:
    return animated(walk(*build(RIGS["mixamo"]), 3)).write(
        folder / "a.gltf", buffer="beside"
    ), folder / "keys of it.bin"


def csv(folder: Path) -> tuple[Path, Path]:
    (folder / "a.csv").write_text("0,0\n")
    sidecar_of(folder / "a.csv").write_text("{}")
    return folder / "a.csv", sidecar_of(folder / "a.csv")


@pytest.mark.parametrize("made", [amc, gltf, csv])
def test_a_file_beside_a_motion_counts(
    tmp_path: Path, made: Callable[[Path], tuple[Path, Path]]
) -> None:
    path, beside = made(tmp_path)
    facts = json.loads(json.dumps(facts_of(path)))
    assert [each["file"] for each in facts["beside"]] == [beside.name]
    assert is_still_made_of(path, facts)
    for each in (path, beside):
        os.utime(each)  # another time and the same bytes
    assert is_still_made_of(path, facts)
    for each in (path, beside):
        before = each.read_bytes()
        each.write_bytes(before + b" ")
        assert not is_still_made_of(path, facts)
        each.write_bytes(before)
        assert is_still_made_of(path, facts)
    beside.unlink()
    assert not is_still_made_of(path, facts)


def test_a_file_alone_has_none_beside_it(tmp_path: Path) -> None:
    (tmp_path / "a.bvh").write_text("no BVH")
    (tmp_path / "broken.gltf").write_text("{")
    (tmp_path / "lost.amc").write_text("no ASF is here")
    for path in tmp_path.iterdir():
        assert facts_of(path)["beside"] == []
    with pytest.raises(OSError, match="gone"):
        facts_of(tmp_path / "gone.bvh")


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """A robot with an include and a mesh that collides, each in a file of its own."""
    (tmp_path / "lights.xml").write_text(
        '<mujoco><worldbody><light name="l"/></worldbody></mujoco>'
    )
    (tmp_path / "block.obj").write_text(BLOCK.format(0.1))
    (tmp_path / "robot.xml").write_text(
        EMBER.replace(
            "</mujoco>",
            '<include file="lights.xml"/><asset><mesh name="b" file="block.obj"/></asset>'
            '<worldbody><geom type="mesh" mesh="b" pos="9 9 9"/></worldbody></mujoco>',
        )
    )
    return tmp_path / "robot.xml"


def anew() -> None:
    """As in another process, which has not understood the robot yet."""
    _understood.cache_clear()
    _shape_sha256.cache_clear()


@pytest.mark.parametrize("changed", ["robot.xml", "lights.xml", "block.obj"])
def test_a_robot_is_all_of_its_files(model: Path, changed: str) -> None:
    before = target_sha256(str(model))
    assert target_sha256(str(model)) == before
    path = model.parent / changed
    path.write_text(path.read_text() + ("v 1 1 1\n" if changed == "block.obj" else "\n"))
    anew()
    assert target_sha256(str(model)) != before


def test_a_robots_motion_is_made_of_its_model(model: Path) -> None:
    robot = spark_sim.load(model)
    path = model.parent / "motion.npz"
    robot.save(path)
    facts = facts_of(path) | robot_facts(path, spark_sim.load(path))
    assert facts["robot"] == "robot.xml"
    assert is_still_made_of(path, facts)
    (model.parent / "block.obj").write_text(BLOCK.format(0.2))
    anew()
    assert not is_still_made_of(path, facts)
    model.unlink()
    assert not is_still_made_of(path, facts)
    named = robot_facts(path, spark_sim.load("robot"))
    assert named["robot"] == "robot"
    assert is_still_made_of(path, facts_of(path) | named)


def test_a_character_is_all_of_its_files(tmp_path: Path) -> None:
    path, beside = gltf(tmp_path)
    before = target_sha256(str(path))
    beside.write_bytes(beside.read_bytes() + b" ")
    assert target_sha256(str(path)) != before


def test_files_that_are_given_for_reading_count(tmp_path: Path) -> None:
    roles = tmp_path / "map.toml"
    roles.write_text("one")
    before = reading_sha256({"roles": roles, "unit": "cm"})
    assert before.keys() == {"roles"}
    roles.write_text("other")
    assert reading_sha256({"roles": roles}) != before
    assert reading_sha256({"robot": "robot"}).keys() == {"robot"}
    with pytest.raises(SparkSimError, match=r"gone.npz: can't be read"):
        _ = Options(reading={"body_model": tmp_path / "gone.npz"}).reading_sha256


def test_a_folder_that_is_a_motion_is_its_files(tmp_path: Path) -> None:
    for name in ("joint_pos.csv", "joint_vel.csv"):
        np.savetxt(tmp_path / name, np.zeros((2, 2)))
    facts = facts_of(tmp_path)
    assert is_still_made_of(tmp_path, facts)
    (tmp_path / "joint_vel.csv").write_text("")
    assert not is_still_made_of(tmp_path, facts)
