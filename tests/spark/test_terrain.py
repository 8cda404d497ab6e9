"""Stated ground: what is on top of it, and which of its parts are closed."""

import numpy as np

from spark.terrain import Terrain, boxed
from tests.helpers.grounds import box, hill, profile, stairs, together

FAR = 1e3


def test_the_top_of_a_box_is_over_it_and_nothing_beside_it() -> None:
    tops = box((0, 0, 0.2), (1, 2, 0.5)).tops(np.array([[0.5, 1.0, 3.0], [1.01, 1.0, 3.0]]), 0.0)
    np.testing.assert_allclose(tops, [0.5, -np.inf])


def test_what_is_above_a_place_is_not_below_it() -> None:
    table = together(box((0, 0, 0), (1, 1, 0.1)), box((0, 0, 0.7), (1, 1, 0.75)))
    points = np.array([[0.5, 0.5, 0.3], [0.5, 0.5, 0.72], [0.5, 0.5, 0.72], [0.5, 0.5, 2.0]])
    np.testing.assert_allclose(
        table.tops(points, np.array([0.2, 0.0, 0.05, 0.0])), [0.1, 0.1, 0.75, 0.75]
    )


def test_edges_between_triangles_are_neither_holes_nor_counted_twice() -> None:
    """A column on the diagonal of a box, along its middle and on the joint of two boxes."""
    both = together(box((0, 0, 0), (1, 1, 1)), box((1, 0, 0), (2, 1, 1)))
    x = np.linspace(0.05, 1.95, 39)
    for y in (x % 1, np.full(39, 0.5)):
        points = np.stack([x, y, np.full(39, 5.0)], axis=1)
        np.testing.assert_allclose(both.tops(points, 0.0), 1.0, atol=1e-12)


def test_a_surface_is_open_where_an_edge_is_one_triangles_alone() -> None:
    solid = box((0, 0, 0), (1, 1, 1))
    assert solid.closed.tolist() == [True]
    assert Terrain(solid.vertices, solid.faces[1:]).closed.tolist() == [False]
    both = together(solid, hill(0.3, 1.0, 0.5))
    assert both.closed[both.parts[[0, -1]]].tolist() == [True, False]


def test_vertices_that_are_written_again_for_each_face_hang_together() -> None:
    solid = box((0, 0, 0), (1, 1, 1))
    apart = Terrain(solid.corners.reshape(-1, 3), np.arange(36).reshape(-1, 3))
    assert apart.closed.tolist() == [True]


def test_the_way_faces_look_does_not_matter() -> None:
    solid = box((0, 0, 0), (1, 1, 1))
    turned = Terrain(solid.vertices, solid.faces[:, ::-1])
    points = np.array([[0.5, 0.25, 2.0]])
    np.testing.assert_allclose(together(solid, turned).tops(points, 0.0), 1.0)


def test_stairs_are_as_high_as_their_steps() -> None:
    flight = stairs(3, 0.2, 0.3, 1.0)
    points = np.array([[x, 0.1, FAR] for x in (1.1, 1.4, 1.7, 0.9)])
    np.testing.assert_allclose(flight.tops(points, 0.0), [0.2, 0.4, 0.6, -np.inf])


def test_a_slope_is_as_high_as_its_plane_says() -> None:
    ramp = profile(np.array([[0.0, 0.0], [2.0, 1.0]]), 2.0)
    np.testing.assert_allclose(ramp.tops(np.array([[0.6, 0.3, FAR]]), 0.0), 0.3, atol=1e-6)


def test_placing_scales_what_was_shifted() -> None:
    placed = box((0, 0, 1), (1, 1, 2)).placed(0.5, np.array([0.0, 0.0, -1.0]))
    np.testing.assert_allclose(placed.vertices.min(axis=0), [0, 0, 0])
    np.testing.assert_allclose(placed.vertices.max(axis=0), 0.5)


def test_each_place_is_met_once_by_the_triangles_around_it_and_by_few_others() -> None:
    ground, places = hill(0.3, 1.0, 0.25), np.random.default_rng(0).uniform(-5, 5, (500, 2))
    low, high = (bound(ground.corners[..., :2], axis=1) for bound in (np.min, np.max))
    found = [*boxed(places[:, 0], places[:, 1], low, high)]
    met = np.concatenate([np.stack(pair, axis=1) for pair in found])
    inside = ((places >= low[:, None]) & (places <= high[:, None])).all(axis=2)
    times = np.zeros(inside.shape, dtype=int)
    np.add.at(times, tuple(met.T), 1)
    assert times[inside].min() == times.max() == 1
    assert len(met) < 5 * inside.sum()


def test_the_way_up_leads_out_of_all_parts_that_are_in_or_on_each_other() -> None:
    """Inside a box under another, in both, in none, between two, and below an open surface."""
    low, high = box((0, 0, 0), (1, 1, 0.3)), box((0.5, 0, 0.2), (1, 1, 0.7))
    both = together(low, high, box((0, 0, 0.9), (1, 1, 1.0)))
    points = np.array([[0.2, 0.5, 0.1], [0.7, 0.5, 0.1], [0.7, 0.5, 0.8], [0.2, 1.5, 0.1]])
    np.testing.assert_allclose(both.way_up(points), [0.2, 0.6, 0.0, 0.0], atol=1e-9)
    single = both.way_up(points.astype(np.float32))
    np.testing.assert_allclose(single, [0.2, 0.6, 0.0, 0.0], atol=1e-6)
    ramp = profile(np.array([[0.0, 0.0], [2.0, 1.0]]), 2.0)
    points = np.array([[0.6, 0.3, 0.1], [0.6, 0.3, -5.0], [0.6, 0.3, 0.4]])
    np.testing.assert_allclose(ramp.way_up(points), [0.2, 5.3, 0.0], atol=1e-6)
