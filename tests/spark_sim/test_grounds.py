"""Stated ground from files of several kinds."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import spark_sim
from robots.model.known import known
from spark.errors import FileFormatError
from spark.io.convention import Convention
from spark.io.terrain_file import write_obj
from spark_sim.choices import Format
from spark_sim.clips import RobotClip
from spark_sim.grounds import read_ground
from tests.helpers.grounds import box

THERE = box((-0.2, -0.5, 0.0), (1.4, 0.5, 0.47))


def test_a_mesh_is_in_the_motions_unit_and_a_model_is_in_metres(tmp_path: Path) -> None:
    write_obj(THERE, tmp_path / "a.obj")
    (tmp_path / "a.xml").write_text(
        '<mujoco><worldbody><geom type="box" size=".8 .5 .235" pos=".6 0 .235"/>'
        "</worldbody></mujoco>"
    )
    in_cm = Convention(0.01, "z")
    mesh, (note,) = read_ground(tmp_path / "a.obj", in_cm)
    model, _ = read_ground(tmp_path / "a.xml", in_cm)
    for bound in (np.min, np.max):
        own = bound(THERE.vertices, axis=0)
        np.testing.assert_allclose(bound(mesh.vertices, axis=0), 0.01 * own)
        np.testing.assert_allclose(bound(model.vertices, axis=0), own)
    assert "unit cm, z up" in note


def test_what_is_neither_mesh_nor_model_is_refused(tmp_path: Path) -> None:
    with pytest.raises(FileFormatError, match=r"no terrain; expected .*\.obj.*\.urdf"):
        read_ground(tmp_path / "a.png", Convention(1.0, "z"))


@pytest.mark.parametrize("format", ["npz", "mjlab", "csv", "gmr", "sonic"])
def test_a_result_has_its_ground_in_each_format_and_the_next_has_it_no_more(
    tmp_path: Path, format: Format
) -> None:
    robot = known("robot")
    clip = spark_sim.retarget(
        spark_sim.load(spark_sim.sample(tmp_path)[0]).part(end=1.0).resampled(50.0), "robot"
    )
    with_ground = RobotClip(replace(clip.on_robot, terrain=THERE), "on a box")
    suffix = {"csv": ".csv", "gmr": ".pkl", "sonic": ""}.get(format, ".npz")
    path = tmp_path / f"out{suffix}"
    with_ground.save(path, format=format)
    read = spark_sim.load(path, robot=robot.mjcf.path)
    assert read.terrain is not None
    np.testing.assert_allclose(read.terrain.corners, THERE.corners, atol=1e-6)
    clip.save(path, format=format, force=True)
    assert spark_sim.load(path, robot=robot.mjcf.path).terrain is None
