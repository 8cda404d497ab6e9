"""Balls that reach as far as shapes do: against each shape's own support function."""

import mujoco
import numpy as np
import pytest

from robots.model.hull import hull, part_of_hull
from sim.outline import fibonacci_sphere

SPARED = 0.003
SIZE = np.array([0.12, 0.05, 0.08])
SHAPES = {  # type and size as MJCF has them; how far it reaches along a unit vector in its own axes
    "box": ("0.12 0.05 0.08", lambda d: np.abs(d) @ SIZE),
    "ellipsoid": ("0.12 0.05 0.08", lambda d: np.linalg.norm(d * SIZE, axis=1)),
    "sphere": ("0.07", lambda d: np.full(len(d), 0.07)),
    "capsule": ("0.04 0.1", lambda d: 0.04 + 0.1 * np.abs(d[:, 2])),
    "cylinder": ("0.04 0.1", lambda d: 0.04 * np.hypot(d[:, 0], d[:, 1]) + 0.1 * np.abs(d[:, 2])),
}


@pytest.mark.parametrize("kind", SHAPES)
def test_balls_reach_as_far_as_a_shape_and_hardly_farther(kind: str) -> None:
    size, support = SHAPES[kind]
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><worldbody><geom type="{kind}" size="{size}" pos="0.2 -0.1 0.3" '
        'euler="20 -35 50"/></worldbody></mujoco>'
    )
    ways = fibonacci_sphere(1000)
    points, radii = hull(model, [0], SPARED)
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    rotation, place = data.geom_xmat[0].reshape(3, 3), data.geom_xpos[0]
    found = (ways @ (points - place).T + radii).max(axis=1)
    farther = found - support(ways @ rotation)
    assert farther.min() > -SPARED / 2  # between the directions that are tried
    assert farther.max() < SPARED + 1e-6


def test_few_balls_do_for_shapes_that_lie_in_others() -> None:
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><geom type="sphere" size="0.1"/><geom size="0.02" pos="0.03 0 0"/>'
        '<geom type="box" size="0.05 0.05 0.05"/></worldbody></mujoco>'
    )
    points, radii = hull(model, [0, 1, 2], SPARED)
    np.testing.assert_allclose(points, np.zeros((1, 3)), atol=1e-12)
    np.testing.assert_allclose(radii, [0.1 + SPARED])


def test_no_shape_reaches_anywhere() -> None:
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    points, radii = hull(model, [], SPARED)
    assert points.shape == (0, 3)
    assert radii.shape == (0,)


def test_part_of_a_hull_lies_on_a_face_whose_corners_are_far_away() -> None:
    corners = np.array(np.meshgrid([-0.2, 0.2], [-0.3, 0.3], [-0.1, 0.1])).reshape(3, -1).T
    place, within = np.array([0.02, 0.01, -0.05]), 0.12
    points, radii = part_of_hull((corners, np.full(8, 0.01)), place[None], within, SPARED)
    away = np.linalg.norm(points - place, axis=1) - radii
    assert (away <= within).all()
    assert (points[:, 2] - radii).min() == pytest.approx(-0.11)
    assert np.linalg.norm(corners - place, axis=1).min() - 0.01 > within


def test_nothing_of_a_hull_that_is_far_away_is_part_of_it() -> None:
    points, radii = part_of_hull((np.eye(3), np.zeros(3)), np.full((1, 3), -1.0), 0.5, SPARED)
    assert len(points) == len(radii) == 0
