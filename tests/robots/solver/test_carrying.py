"""Which parts carry a body: those that its weight needs, the lower ones first."""

import numpy as np
import pytest

from robots.solver.carrying import Points, carrying, once_down
from sim.report.mass import Mass
from spark.constants import GRAVITY

FRAME_TIME = 1 / 60
COUNT = 60
TRESTLES = np.array([[-0.4, 0.2], [-0.4, -0.2], [0.4, 0.2], [0.4, -0.2]])


def point_mass(path: np.ndarray) -> Mass:
    """All mass in one point that goes along a path [m]."""
    still = np.tile([1.0, 0, 0, 0], (len(path), 1, 1))
    return Mass(np.ones(1), np.zeros((1, 3, 3)), path[:, None], still)


def carriers(
    heights: list[float],
    com: np.ndarray | None = None,
    places: np.ndarray = TRESTLES,
    soles: np.ndarray | None = None,
) -> list[bool]:
    """Which of the points carry, in the middle frame, beside others at `soles` on the floor."""
    com = np.tile([0.0, 0.0, 0.5], (COUNT, 1)) if com is None else com
    high = np.array(heights)
    parts = np.tile(np.column_stack([places, high]), (COUNT, 1, 1))
    under = np.zeros((COUNT, 0, 3)) if soles is None else np.tile(soles, (COUNT, 1, 1))
    found = carrying(
        point_mass(com),
        Points(parts, np.tile(high, (COUNT, 1))),
        Points(under, under[..., 2]),
        0.0,
        FRAME_TIME,
        1.0,
    )
    carry: list[bool] = found[COUNT // 2].tolist()
    return carry


@pytest.mark.parametrize("hover", [0.0, 0.05, 0.1])
def test_legs_of_a_table_carry_however_high_it_hovers(hover: float) -> None:
    assert carriers([hover] * 4) == [True] * 4


def test_a_weight_over_two_legs_needs_no_others() -> None:
    com = np.tile([0.4, 0.0, 0.5], (COUNT, 1))
    assert carriers([0.05] * 4, com) == [False, False, True, True]


def test_a_leg_carries_that_hovers_where_the_others_would_tip() -> None:
    assert carriers([0.0, 0.0, 0.08, 0.3])[2:] == [True, False]


def test_soles_carry_alone_where_the_weight_is_over_them() -> None:
    soles = np.array([[0.1, 0.1, 0], [0.1, -0.1, 0], [-0.1, 0.1, 0], [-0.1, -0.1, 0]])
    assert carriers([0.05] * 4, soles=soles) == [False] * 4
    assert carriers([0.05] * 4, soles=soles - [0.5, 0, 0]) == [False, False, True, True]


def test_nothing_carries_what_falls() -> None:
    time = FRAME_TIME * np.arange(COUNT)
    fall = np.column_stack([0 * time, 0 * time, 5 - GRAVITY * time**2 / 2])
    assert carriers([0.0] * 4, fall) == [False] * 4


def test_who_speeds_up_leans_on_what_is_behind() -> None:
    """The centre of pressure of a mass at height z, accelerated by a, lies z a / g behind it."""
    time = FRAME_TIME * (np.arange(COUNT) - COUNT // 2)
    com = np.column_stack([0.4 * GRAVITY / 0.5 * time**2 / 2, 0 * time, 0 * time + 0.5])
    assert carriers([0.05] * 4, com) == [True, True, False, False]


def test_a_knee_carries_once_it_is_down() -> None:
    """It comes down within a second, lies, and is raised again; one frame of it is a glitch."""
    down = np.linspace(0.12, 0.01, 60)
    height = np.concatenate([down, np.full(120, 0.01), down[::-1]])
    height[100] = -0.2
    found = once_down(np.ones(len(height), dtype=bool), height)
    assert found[height < 0.05].all()
    assert not found[height > 0.07].any()


def test_a_knee_that_seems_to_hover_carries_all_the_same() -> None:
    touching = np.zeros(100, dtype=bool)
    touching[20:80] = True
    np.testing.assert_array_equal(once_down(touching, np.full(100, 0.1)), touching)
