"""Heights over a floor and what stands on it."""

from dataclasses import replace

import numpy as np

from spark.transfer.ground import Ground, Stand, distinct, level_ground
from tests.helpers.grounds import box, together

BOX = Ground(0.1, np.array([[1.0, 0.0, 0.5]]), (Stand("left foot", 2, 4, 0.5),), hip_height=1.0)


def test_over_a_level_floor_heights_are_over_that() -> None:
    points = np.random.default_rng(0).normal(size=(4, 3, 3))
    np.testing.assert_array_equal(level_ground(0.2).heights(points), points[..., 2] - 0.2)
    np.testing.assert_array_equal(level_ground(0.2).under(points), 0.0)


def test_over_a_slope_heights_are_over_what_is_below() -> None:
    slope = replace(level_ground(0.2), gradient=(0.02, -0.01), middle=(1.0, 2.0))
    points = np.array([[[1.0, 2.0, 0.5], [3.0, 2.0, 0.5], [1.0, 4.0, 0.5]]])
    np.testing.assert_allclose(slope.heights(points), [[0.3, 0.26, 0.32]])
    np.testing.assert_allclose(slope.under(points), [[0.0, 0.04, -0.02]])


def test_what_is_beside_a_box_is_over_the_floor() -> None:
    """On it as far as it reaches, hands farther than feet; below its top beside it."""
    place = np.array([[1.0, 0, 0.7], [1.4, 0, 0.7], [1.6, 0, 0.7], [1.0, 0, 0.45]])
    points = np.tile(place, (1, 1, 1))
    np.testing.assert_allclose(BOX.heights(points), [[0.2, 0.2, 0.6, 0.35]])
    feet = ["right foot"] * 4
    np.testing.assert_allclose(BOX.heights(points, feet), [[0.2, 0.6, 0.6, 0.35]])


def test_a_foot_that_stands_on_a_box_sinks_into_it() -> None:
    points = np.tile([1.0, 0.0, 0.45], (6, 2, 1))
    heights = BOX.heights(points, ["left foot", "right foot"])
    np.testing.assert_allclose(heights[:, 1], 0.35)
    np.testing.assert_allclose(heights[:, 0], [0.35, 0.35, -0.05, -0.05, 0.35, 0.35])
    later = BOX.picked(slice(3, 6)).heights(points[3:], ["left foot", "right foot"])
    np.testing.assert_array_equal(later, heights[3:])


def test_places_that_are_one_are_kept_once() -> None:
    tops = np.array([[0.0, 0, 0.5], [0.15, 0, 0.51], [0.15, 0, 0.6], [0.5, 0, 0.5]])
    np.testing.assert_array_equal(distinct(tops, 1.0), tops[[0, 2, 3]])
    assert distinct(np.zeros((0, 3)), 1.0).shape == (0, 3)


def test_stated_ground_is_as_deep_as_its_nearest_way_out() -> None:
    """In a box near its side and below its top; beside it, over the floor."""
    ground = replace(level_ground(0.0), terrain=box((0, 0, 0), (1, 1, 0.4)))
    points = np.array([[0.03, 0.5, 0.2], [0.5, 0.5, 0.35], [-0.01, 0.5, 0.2], [0.5, 0.5, 0.45]])
    np.testing.assert_allclose(ground.depth(points), [0.03, 0.05, 0.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(
        ground.heights(points[None])[0], [-0.03, -0.05, 0.2, 0.05], atol=1e-6
    )


def test_in_the_corner_of_a_stair_nothing_is_in_the_stated_ground() -> None:
    """Wherever tread and riser lie between the nodes of the grid, and on them."""
    rng = np.random.default_rng(0)
    for riser, rise in ((0.3, 0.2), (0.311, 0.207), (0.295, 0.213)):
        steps = together(box((0, 0, 0), (1, 1, rise)), box((riser, 0, 0), (1, 1, 2 * rise)))
        ground = replace(level_ground(0.0), terrain=steps)
        x, y, z = rng.uniform(0.0, 1.0, (3, 2000))
        above = np.stack([riser - 0.05 * x, y, rise + 0.05 * z], axis=1)
        assert not ground.depth(above).any()
        below = above * [1.0, 1.0, 0.0] + [0.0, 0.0, rise - 0.005]
        inner = below[(y > 0.05) & (y < 0.95)]
        assert ground.depth(inner).max() < 0.0051
