"""A foot stands from where something of its sole comes to rest to where the last of it leaves."""

import numpy as np
import pytest
from jaxtyping import Float

from spark.transfer.stances import stances

HEIGHT = 1.75  # [m] an adult: thresholds are what they say


def walked(speed: Float[np.ndarray, "T"], frame_time: float) -> Float[np.ndarray, "T 1 1 3"]:
    """A point on the floor that moves ahead at so many m/s."""
    at = np.zeros((len(speed), 1, 1, 3))
    at[:, 0, 0, 0] = np.cumsum(speed) * frame_time
    return at


def timed(rate: int) -> Float[np.ndarray, "T"]:
    """Seconds, at the middles of frames."""
    return (np.arange(3 * rate) + 0.5) / rate


@pytest.mark.parametrize("rate", [24, 30, 60, 120])
def test_what_rested_stands_until_it_is_fast(rate: int) -> None:
    """By hand: fast for a second, at rest for half of one, slow (0.3 m/s) for as long, fast again;
    but a foot that only slows down to 0.3 m/s never stands."""
    t = timed(rate)
    fast = (t < 1) | (t > 2)
    rolls, passes = (np.where(fast, 2.0, np.where(t < 1.5, rest, 0.3)) for rest in (0.0, 0.3))
    points = np.concatenate([walked(each, 1 / rate) for each in (rolls, passes)], axis=1)
    stands, _ = stances(points, 1 / rate, HEIGHT)
    assert not stands[1].any()
    edge = 0.04 + 1 / rate  # speeds are taken over a fifteenth of a second
    assert stands[0][(t > 1 + edge) & (t < 2 - edge)].all()
    assert not stands[0][(t < 1 - edge) | (t > 2 + edge)].any()


def test_any_end_of_the_sole_will_do() -> None:
    """A heel that is put down, then toes that stay: one stance, in which no point rests all of the
    time."""
    t = timed(60)
    heel, toes = np.where((t > 1) & (t < 1.5), 0.0, 2.0), np.where((t > 1.4) & (t < 2), 0.0, 2.0)
    both = np.concatenate([walked(heel, 1 / 60), walked(toes, 1 / 60)], axis=2)
    each, _ = stances(np.concatenate([both[:, :, :1], both[:, :, 1:]], axis=1), 1 / 60, HEIGHT)
    np.testing.assert_array_equal(stances(both, 1 / 60, HEIGHT)[0][0], each.any(axis=0))


@pytest.mark.parametrize("rate", [30, 60, 120])
def test_a_moment_is_no_stance_but_where_the_motion_is_cut(rate: int) -> None:
    """A foot in the air that is low for 0.05 s: not a stance; of two longer ones with 0.05 s in
    the air between them one is made; and what is cut by the motion's ends may have been longer."""
    t = timed(rate)

    def stands(low: np.ndarray) -> np.ndarray:
        at = np.zeros((len(t), 1, 1, 3))
        at[:, 0, 0, 2] = np.where(low, 0.0, 0.3)
        return stances(np.concatenate([at, 0 * at], axis=1), 1 / rate, HEIGHT)[0][0]

    assert not stands(abs(t - 1.5) < 0.026)[rate:-rate].any()
    apart = stands((abs(t - 1.5) < 0.5) & (abs(t - 1.5) > 0.026))
    assert apart[(t > 1.1) & (t < 1.9)].all()
    assert stands(t < 0.05)[0]
    assert stands(t > 2.95)[-1]


def test_a_foot_held_still_in_the_air_does_not_stand() -> None:
    t = timed(60)
    at = np.zeros((len(t), 2, 1, 3))
    at[:, 0, 0, 2] = np.where((t > 1) & (t < 2), 0.1, 0.0)
    at[:, 0, 0, 0] = np.where((t > 1) & (t < 2), 0.3, 0.0)
    stands, _ = stances(at, 1 / 60, HEIGHT)
    assert not stands[0][(t > 1.05) & (t < 1.95)].any()
    assert stands[0][(t < 0.9) | (t > 2.1)].all()
    assert stands[1].all()


def test_a_foot_that_turns_on_its_ball_stands() -> None:
    """Both ends go round at 1 m/s; a ball that slides at 0.3 m/s holds nothing."""
    t = timed(60)
    ends = walked(np.where((t > 1) & (t < 2), 1.0, 0.0), 1 / 60)
    for speed, expected in ((0.05, True), (0.3, False)):
        ball = walked(np.where((t > 1) & (t < 2), speed, 0.0), 1 / 60)[:, :, 0]
        stands, flat = stances(ends, 1 / 60, HEIGHT, balls=ball)
        turns = (t > 1.1) & (t < 1.9)
        assert (stands[0][turns] == expected).all()
        assert not flat[0][turns].any()
        assert stands[0][~turns & ((t < 0.9) | (t > 2.1))].all()
