"""Stated ground as models have it."""

from pathlib import Path

import numpy as np
import pytest

from robots.model.fixed_shapes import read_fixed_shapes
from spark.errors import FileFormatError

MODEL = """<mujoco><worldbody>
  <geom type="plane" size="1 1 1"/>
  <body pos="1 0 0"><geom type="box" size=".5 .4 .1" pos="0 0 .1"/></body>
  <geom type="cylinder" size=".3 .2" pos="-2 0 .2"/>
  <body pos="0 0 2"><freejoint/><geom type="sphere" size=".1"/></body>
</worldbody></mujoco>"""


def test_what_is_fixed_is_ground_and_what_moves_and_planes_are_not(tmp_path: Path) -> None:
    (tmp_path / "world.xml").write_text(MODEL)
    terrain, _ = read_fixed_shapes(tmp_path / "world.xml")
    points = np.array([[1.4, 0.3, 9.0], [-2.0, 0.1, 9.0], [0.0, 0.0, 9.0]])
    np.testing.assert_allclose(terrain.tops(points, 0.0), [0.2, 0.4, -np.inf])
    assert terrain.closed.tolist() == [True, True]
    a, b, c = terrain.corners.swapaxes(0, 1)
    volumes = np.bincount(terrain.parts, (a * np.cross(b, c)).sum(axis=1) / 6)
    np.testing.assert_allclose(sorted(volumes), [np.pi * 0.3**2 * 0.4, 1.0 * 0.8 * 0.2], rtol=2e-3)


def test_a_world_of_planes_alone_is_no_terrain(tmp_path: Path) -> None:
    plane = '<mujoco><worldbody><geom type="plane" size="1 1 1"/></worldbody></mujoco>'
    (tmp_path / "world.xml").write_text(plane)
    with pytest.raises(FileFormatError, match="no fixed shapes"):
        read_fixed_shapes(tmp_path / "world.xml")
