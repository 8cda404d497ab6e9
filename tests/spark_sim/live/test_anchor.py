"""A person who is put elsewhere, and one who only runs."""

import numpy as np
import pytest

from robots.stream.frame_targets import Frame
from spark_sim.live.anchor import Anchor
from spark_sim.live.listener import Arrival


def place_of(anchor: Anchor, x: float, came: float) -> float:
    frame = Frame(np.array([x, 0.0, 1.0]), np.array([[1.0, 0, 0, 0]]))
    return float(anchor.hold(Arrival(frame, came, None)).root_pos[0])


@pytest.mark.parametrize("rate", [30.0, 60.0, 240.0])
def test_a_runner_is_followed_though_packets_come_in_bursts(rate: float) -> None:
    told: list[str] = []
    anchor = Anchor(1 / 60, told.append)
    made = np.arange(200) / rate
    came = made + (np.arange(200) % 3 == 0) * 0.9 / rate  # each third with the next one
    x = [place_of(anchor, 5 * t, arrived) for t, arrived in zip(made, np.sort(came), strict=True)]
    np.testing.assert_allclose(x, 5 * made)
    assert told == []


@pytest.mark.parametrize(("gap", "jump"), [(1 / 60, 0.25), (2.0, 0.7)])
def test_who_is_put_elsewhere_stays(gap: float, jump: float) -> None:
    """At once, or while nothing came; what they do afterwards is followed from where they were."""
    told: list[str] = []
    anchor = Anchor(1 / 60, told.append)
    assert place_of(anchor, 1.0, 0.0) == 1.0
    assert place_of(anchor, 1.0 + jump, gap) == pytest.approx(1.0)
    assert place_of(anchor, 1.02 + jump, gap + 1 / 60) == pytest.approx(1.02)
    assert len(told) == 1
    assert f"jumped by {jump:.2f} m" in told[0]


def test_a_step_aside_while_nothing_came_is_followed() -> None:
    told: list[str] = []
    anchor = Anchor(1 / 60, told.append)
    assert place_of(anchor, 0.0, 0.0) == 0.0
    assert place_of(anchor, 0.5, 2.0) == 0.5
    assert told == []
