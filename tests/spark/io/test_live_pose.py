"""What time it is for a sender."""

import numpy as np
import pytest

from spark.io import mvn as datagrams
from spark.io.live_pose import SampleClock
from spark.io.mvn_pose import MvnPose
from spark.io.vmc import VmcPose
from tests.helpers import mvn, vmc


@pytest.mark.parametrize("rate", [60.0, 90.0, 240.0])
def test_samples_tell_more_than_milliseconds(rate: float) -> None:
    """Milliseconds alone are off by a quarter of an interval at 240 samples a second."""
    clock = SampleClock()
    samples = np.arange(100, 100 + round(20 * rate))
    times = [clock.at(int(k), int(1000 * k / rate)) for k in samples]
    assert times[0] is None
    told = np.array(times[round(5 * rate) :], dtype=float)
    np.testing.assert_allclose(np.diff(told) * rate, 1.0, atol=0.002)


def test_a_clock_that_stands_still_tells_nothing() -> None:
    clock = SampleClock()
    assert [clock.at(k, 7) for k in range(5)] == [None] * 5


def test_lost_samples_another_rate_and_another_start() -> None:
    clock = SampleClock()
    sent = [(k, 10 * k) for k in range(300) if k % 7]  # 100 a second
    sent += [(300 + k, 3000 + 20 * k) for k in range(300)]  # 50 a second
    sent += [(k, 20 * k) for k in range(300)]
    told = [clock.at(*each) for each in sent]
    for begin, end in ((2, 250), (260, 550), (560, 850)):
        took = np.diff(np.array(told[begin:end], dtype=float))
        true = 0.001 * np.diff([ms for _, ms in sent[begin:end]])
        np.testing.assert_allclose(took, true, atol=1e-9)
    assert told.count(None) == 3


def test_the_protocols_tell_when_a_pose_was_made() -> None:
    person, placed = MvnPose(), mvn.world({})
    values = {n: [*p, *t.as_quat()[[3, 0, 1, 2]]] for n, (p, t) in placed.items()}
    times = []
    for k in range(4):
        person.take(datagrams.pose_datagram(values, sample=k, time_ms=50 * k), 0.05 * k)
        times.append(person.clock)
    assert times[0] is None
    np.testing.assert_allclose(np.diff(np.array(times[1:], dtype=float)), 0.05)

    app = VmcPose()
    assert app.take(vmc.packet({}, 12.5), 0.0)
    assert app.clock == 12.5
    assert app.take(vmc.packet({}, 8192.5), 0.1)  # of a single float, a millisecond is left
    assert app.clock is None
