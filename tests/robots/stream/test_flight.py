"""How high a stream throws its robot, on heights that are worked out by hand."""

import numpy as np
import pytest

from robots.stream.flight import FALL, STANDING, Flight
from spark.constants import GRAVITY

FRAME_TIME, HIPS = 1 / 60, 0.9


def thrown(heights: np.ndarray, scale: float) -> np.ndarray:
    flight = Flight(scale, HIPS, FRAME_TIME)
    return np.array([flight.follow(float(height)) for height in heights])


def flight(g: float) -> np.ndarray:
    """Half a second in the air between two at rest."""
    time = FRAME_TIME * np.arange(31)
    return np.concatenate([np.full(30, HIPS), HIPS + g / 2 * time * (0.5 - time), np.full(9, HIPS)])


def test_a_small_robot_falls_nearly_as_fast_as_all_bodies() -> None:
    heights = flight(GRAVITY)
    gained = thrown(heights, 0.6)
    falling = np.diff(0.6 * heights + gained, 2) / FRAME_TIME**2
    surely = np.flatnonzero(heights > 1.15 * HIPS)
    assert len(surely) > 12
    np.testing.assert_allclose(falling[surely - 1][1:-1], -FALL * GRAVITY, rtol=0.1)
    low = heights < STANDING * HIPS
    np.testing.assert_array_equal(gained[low], 0.0)


@pytest.mark.parametrize("scale", [0.5, 1.1])
def test_what_falls_fast_enough_is_not_thrown(scale: float) -> None:
    """A source that is twice as large as a man falls twice as fast."""
    assert not thrown(flight((2 if scale < 1 else 1) * GRAVITY), scale).any()


def test_who_rises_on_tiptoe_is_not_thrown() -> None:
    time = FRAME_TIME * np.arange(60)
    assert not thrown(HIPS * (1 + 0.15 * np.sin(np.pi * time) ** 2), 0.6).any()
