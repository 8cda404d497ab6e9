"""Distances from stated ground, against those worked out by hand."""

import numpy as np
import pytest
from jaxtyping import Float

from spark.terrain import Terrain
from spark.transfer.distance_field import DistanceField, distance_field, on_triangles
from tests.helpers.grounds import box, hill, stairs, together

SPACING = 0.02
LOW, HIGH = np.full(3, -3.0), np.full(3, 3.0)
RNG = np.random.default_rng(0)


def around(terrain: Terrain) -> DistanceField:
    return distance_field(terrain, LOW, HIGH, SPACING)


def from_box(points: np.ndarray, low: np.ndarray, high: np.ndarray) -> Float[np.ndarray, "N"]:
    """The signed distance of a box (Quilez)."""
    beyond = np.abs(points - (low[:, None] + high[:, None]) / 2) - (high - low)[:, None] / 2
    outside = np.linalg.norm(np.maximum(beyond, 0.0), axis=0)
    return outside + np.minimum(beyond.max(axis=0), 0.0)


def test_distances_from_a_box_are_its_own() -> None:
    low, high = np.array([-0.41, -0.3, 0.0]), np.array([0.5, 0.33, 0.47])
    points = RNG.uniform(low[:, None] - 0.1, high[:, None] + 0.1, (3, 4000))
    off = around(box(tuple(low), tuple(high))).distance(points) - from_box(points, low, high)
    assert np.abs(off).max() < SPACING / 3  # at edges, which the grid rounds
    assert np.abs(off).mean() < SPACING / 50


def test_ways_out_are_those_of_the_nearest_side() -> None:
    field = around(box((-0.5, -0.5, 0.0), (0.5, 0.5, 0.4)))
    points = np.array([[0.0, 0.1, 0.39], [0.49, 0.1, 0.2], [0.1, -0.52, 0.2]]).T
    out = field.away(points).out
    np.testing.assert_allclose(out, np.array([[0, 0, 1], [1, 0, 0], [0, -1, 0]]).T, atol=1e-6)


def test_parts_in_each_other_have_no_surface_inside() -> None:
    one, other = box((-0.5, -0.3, 0.0), (0.1, 0.3, 0.4)), box((-0.1, -0.3, 0.0), (0.5, 0.3, 0.4))
    points = np.stack([np.linspace(-0.3, 0.3, 61), np.zeros(61), np.full(61, 0.3)])
    np.testing.assert_allclose(around(together(one, other)).distance(points), -0.1, atol=1e-6)


def test_beside_a_seam_what_is_deep_is_pushed_up() -> None:
    """Two boxes that touch: nothing hides between them."""
    one, other = box((-0.5, -0.3, 0.0), (0.0, 0.3, 0.4)), box((0.0, -0.3, 0.0), (0.5, 0.3, 0.4))
    points = np.stack([np.linspace(-0.1, 0.1, 41), np.zeros(41), np.full(41, 0.4 - 2.5 * SPACING)])
    away = around(together(one, other)).away(points)
    np.testing.assert_allclose(away.distance, -2.5 * SPACING, atol=1e-6)
    np.testing.assert_allclose(away.out[2], 1.0, atol=1e-6)


def test_below_an_open_surface_all_is_solid() -> None:
    field = around(hill(0.5, 0.6, 0.05))
    assert field.distance(np.array([[0.0], [0.0], [0.45]]))[0] == pytest.approx(-0.05, abs=0.005)
    assert field.distance(np.array([[0.3], [0.2], [0.1]]))[0] < -0.2


def test_in_the_corner_of_a_stair_the_nearer_of_tread_and_riser_counts() -> None:
    field = around(stairs(2, 0.2, 0.3, 0.0))
    points = np.array([[0.22, 0.0, 0.21], [0.29, 0.0, 0.3], [0.35, 0.0, 0.25]]).T
    np.testing.assert_allclose(field.distance(points), [0.01, 0.01, -0.05], atol=1e-3)


def test_what_is_not_on_the_grid_is_far() -> None:
    assert around(box((0, 0, 0), (1, 1, 1))).distance(np.array([[9.0], [0.0], [0.0]]))[0] > 100


def test_gradients_are_those_of_the_distance() -> None:
    field = around(hill(0.5, 0.6, 0.05))
    points, step = RNG.uniform(-0.4, 0.4, (3, 200)), 1e-6
    points[2] = 0.5 * np.exp(-(points[0] ** 2 + points[1] ** 2) / 0.72) + 0.03
    found = field.away(points)
    for k in range(3):
        shift = step * np.eye(3)[:, [k]]
        slope = (field.distance(points + shift) - field.distance(points - shift)) / (2 * step)
        close = (
            np.abs(slope - found.out[k]) < 0.1
        )  # unit vectors, between nodes as long but for that
        assert close.mean() > 0.95


def test_the_nearest_point_of_a_triangle() -> None:
    triangle = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    points = np.array([[0.2, 0.2, 0.5], [-1, -1, 0], [0.5, -0.3, 0.1], [1, 1, 0]])
    nearest = np.array([[0.2, 0.2, 0], [0, 0, 0], [0.5, 0, 0], [0.5, 0.5, 0]])
    found = on_triangles(points, np.repeat(triangle[None], 4, axis=0))
    np.testing.assert_allclose(found, nearest, atol=1e-12)


def test_a_triangle_without_a_side_is_its_longest_edge() -> None:
    line = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 0, 0]])
    np.testing.assert_allclose(on_triangles(np.array([[0.7, 1.0, 0.0]]), line[None]), [[0.7, 0, 0]])
