"""What comes to rest is slow already as it does."""

import numpy as np
import pytest

from robots.solver.foot_path import SETTLE as FOOT
from robots.solver.resting import SETTLE as PART
from robots.solver.settling import led, settled


@pytest.mark.parametrize("times", [[False] * 9, [True] * 9])
def test_a_part_that_rests_never_or_always_keeps_its_path(times: list[bool]) -> None:
    path = np.random.default_rng(0).normal(size=(9, 2))
    np.testing.assert_array_equal(settled(path, np.array(times), 1 / 60, 0.1), path)


@pytest.mark.parametrize("seconds", [FOOT, PART])
@pytest.mark.parametrize("rate", [30, 60, 120])
def test_a_part_is_slow_already_as_it_comes_to_rest(rate: int, seconds: float) -> None:
    """It comes at 1 m/s, lies for .5 s, and leaves at 1 m/s; long before and after it is free."""
    time = np.arange(2 * rate) / rate
    rests = (time >= 0.75) & (time < 1.25)
    along = np.minimum(time, 0.75) + np.maximum(time, 1.25) - 1.25
    path = np.stack([along, np.zeros_like(along)], axis=1)
    path[rests] = path[np.flatnonzero(rests)[0]]
    found = settled(path, rests, 1 / rate, seconds)
    np.testing.assert_array_equal(found[rests], path[rests])
    free = np.abs(time - 1.0) > 0.25 + seconds + 1 / rate
    np.testing.assert_allclose(found[free], path[free], atol=1e-12)
    steps = np.linalg.norm(np.diff(found, axis=0), axis=1) * rate
    first, last = np.flatnonzero(rests)[[0, -1]]
    assert steps[[first - 1, last]].max() < 0.25  # from 1 m/s


def test_a_short_way_between_two_rests_is_left_a_third_of_its_time() -> None:
    """Six frames of a shuffle: no faster than three times its speed."""
    rests = np.ones(60, dtype=bool)
    rests[27:33] = False
    path = np.interp(np.arange(60), [26, 33], [0.0, 0.07])[:, None]
    steps = np.diff(settled(path, rests, 1 / 60, 0.1)[:, 0])
    assert steps.min() >= 0
    assert steps.max() < 3 * 0.01


def test_around_a_rest_a_path_goes_as_its_guide_and_far_away_as_it_did() -> None:
    """It swings by in a circle, as the guide comes straight to where it lies, and goes on."""
    time = np.arange(180) / 60
    rests = (time > 1.4) & (time < 1.6)
    path = np.stack([np.sin(2 * np.pi * time), np.cos(2 * np.pi * time)], axis=1)
    path[rests] = path[90]
    away = np.maximum(np.abs(time - 1.5) - 0.1, 0.0)
    guide = np.stack([0.5 * away, np.full_like(time, 7.0)], axis=1)
    found = led(path, guide, rests, 1 / 60, 0.4)
    np.testing.assert_array_equal(found[rests], path[rests])
    free = np.abs(time - 1.5) > 0.1 + 0.4 + 1 / 60
    np.testing.assert_allclose(found[free], path[free], atol=1e-12)
    near = (np.abs(time - 1.5) < 0.1 + 0.03) & ~rests
    straight = path[90] + [0.5, 0.0] * away[near, None]
    np.testing.assert_allclose(found[near], straight, atol=0.06)
    assert np.abs(path[near] - straight).max() > 0.3


def test_a_rest_is_left_and_reached_at_once_by_a_path_that_is_its_own_guide() -> None:
    path = np.random.default_rng(1).normal(size=(50, 2))
    rests = np.zeros(50, dtype=bool)
    rests[20:25] = True
    np.testing.assert_allclose(led(path, path + 3.0, rests, 1 / 60, 0.1), path, atol=1e-12)
