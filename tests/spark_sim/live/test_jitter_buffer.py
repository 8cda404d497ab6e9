"""Constant motion comes out constant, whatever the way did to it. All times are given."""

from collections.abc import Callable, Iterable

import numpy as np
import pytest
from jaxtyping import Float
from scipy.spatial.transform import Rotation

from robots.stream.frame_targets import Frame
from spark_sim.live.jitter_buffer import JitterBuffer

V, W = 1.3, 2.0  # [m/s, rad/s]: a person who walks and turns
LONG, FIRST = 8.0, 0.2  # [s]: when poses end, and when steps begin
Rows = Float[np.ndarray, "N"]
Packet = tuple[float, float, float | None]
"""When it arrives, when it was made, and what the sender's clock says of that [s]."""


def pose(made: float) -> Frame:
    x, y, z, w = Rotation.from_rotvec([0.0, 0.0, W * made]).as_quat()
    place = np.array([V * made, 0.0, 1.0])
    return Frame(place, np.array([[w, x, y, z]]), place[None] / 2)


def sent(
    rate: float, delay: Callable[[int], Rows] = np.zeros, *, stamped: bool = True
) -> list[Packet]:
    """Poses of LONG seconds, of which each takes its own time on the way; UDP may shuffle them, and
    the listener then drops the older ones."""
    made = np.arange(0.0, LONG, 1 / rate)
    arrived = np.maximum.accumulate(made + delay(len(made)))
    return [
        (a, m, 1000.0 + m if stamped else None)
        for a, m in zip(arrived.tolist(), made.tolist(), strict=True)
    ]


def steps(fps: float) -> Rows:
    """The times of steps."""
    return np.arange(FIRST, LONG - 0.01, 1 / fps)


def played(
    packets: Iterable[Packet], fps: float, buffer: JitterBuffer | None = None
) -> list[Frame]:
    """What each step gets."""
    buffer, waiting, frames = buffer or JitterBuffer(), sorted(packets), []
    for now in (steps(fps) + 0.002).tolist():  # as sessions have it
        while waiting and waiting[0][0] <= now:
            arrived, made, stamp = waiting.pop(0)
            buffer.put(pose(made), arrived, stamp)
        frames.append(buffer.get(now))
    return frames


def speeds(frames: list[Frame], fps: float, *, since: float = 2.0) -> Rows:
    """How fast the person goes, of the true speed."""
    x = np.array([frame.root_pos[0] for frame in frames[round(since * fps) :]])
    return np.diff(x) * fps / V


def jitter(longest: float) -> Callable[[int], Rows]:
    return lambda count: np.random.default_rng(5).uniform(0.0, longest, count)


@pytest.mark.parametrize("rate", [26.0, 30.0, 60.0, 90.0, 240.0])
@pytest.mark.parametrize("fps", [60.0, 120.0])
def test_a_steady_sender_of_any_rate_is_steady(rate: float, fps: float) -> None:
    buffer = JitterBuffer()
    frames = played(sent(rate), fps, buffer)
    np.testing.assert_allclose(speeds(frames, fps), 1.0, atol=0.02)
    assert buffer.wait < 1 / rate
    assert buffer.rate == pytest.approx(rate, rel=0.01)
    for frame in frames[180:190]:
        expected = pose(frame.root_pos[0] / V)  # all parts of a pose are of one time
        np.testing.assert_allclose(np.abs(frame.rotations), np.abs(expected.rotations), atol=1e-6)
        np.testing.assert_allclose(frame.translations, expected.translations)


@pytest.mark.parametrize("rate", [60.0, 120.0])
def test_a_sender_as_fast_as_the_steps_is_left_alone(rate: float) -> None:
    """The newest pose counts, and no pose waits."""
    buffer = JitterBuffer()
    frames = played(sent(rate), 60.0, buffer)
    x = [frame.root_pos[0] for frame in frames]
    np.testing.assert_allclose(x, V * steps(60.0), atol=1e-9)
    assert buffer.wait == pytest.approx(0.0, abs=1e-9)


def test_a_slow_sender_costs_what_it_takes_to_know_its_next_pose() -> None:
    """At 30 poses a second every other step has no news: the way to the next pose is a step."""
    buffer = JitterBuffer()
    x = [frame.root_pos[0] for frame in played(sent(30.0), 60.0, buffer)]
    assert buffer.wait == pytest.approx(1 / 60, abs=1e-6)
    np.testing.assert_allclose(x[120:], V * (steps(60.0)[120:] - 1 / 60), atol=1e-4)


@pytest.mark.parametrize("rate", [30.0, 60.0])
@pytest.mark.parametrize(("stamped", "share"), [(True, 0.5), (False, 0.25)])
def test_jitter_is_evened_out(rate: float, stamped: bool, share: float) -> None:
    """Of half an interval, or a quarter where arrivals are all that is known; without the buffer
    the person stops and starts."""
    packets = sent(rate, jitter(share / rate), stamped=stamped)
    np.testing.assert_allclose(speeds(played(packets, 60.0), 60.0), 1.0, atol=0.1)
    newest = [max(m for a, m, _ in packets if a <= now + 0.002) for now in steps(60.0)]
    assert np.diff(newest).min() * 60 == pytest.approx(0.0, abs=1e-9)
    assert np.diff(newest).max() * 60 == pytest.approx(2.0, abs=1e-9)


@pytest.mark.parametrize("stamped", [True, False])
def test_two_poses_in_five_may_be_lost(stamped: bool) -> None:
    buffer, rng = JitterBuffer(), np.random.default_rng(3)
    packets = [p for p in sent(60.0, stamped=stamped) if rng.random() > 0.4]
    moved = speeds(played(packets, 60.0, buffer), 60.0)
    assert moved.max() < 1.3
    assert (np.abs(moved - 1) < 0.25).mean() > 0.9
    assert buffer.wait < 0.1
    assert buffer.rate == pytest.approx(36.0, rel=0.15)


def test_a_stall_holds_the_pose_and_the_way_back_is_no_jump() -> None:
    buffer = JitterBuffer()
    frames = played([p for p in sent(60.0) if not 3.0 < p[1] < 4.0], 60.0, buffer)
    x = np.array([frame.root_pos[0] for frame in frames])
    silent = (steps(60.0) > 3.05) & (steps(60.0) < 3.95)
    assert np.ptp(x[silent]) == 0.0
    back = steps(60.0) > 3.5
    assert np.diff(x[back]).max() * 60 < 4.5 * V  # a second to make up for in half a one
    assert np.abs(np.diff(x[back], 2)).max() * 3600 < 36 * V
    later = steps(60.0) > 4.6
    np.testing.assert_allclose(x[later], V * steps(60.0)[later], atol=1e-6)
    assert buffer.wait < 0.002  # and what comes afterwards does not wait for another one


@pytest.mark.parametrize(
    "clock",
    [
        lambda made: 0.0,
        lambda made: -made,
        lambda made: made % 5.0,
        lambda made: made / 2,
        lambda made: 1000 * made,
        lambda made: made + 1e4 * (made > 5.0),
    ],
)
def test_a_clock_that_tells_nothing_is_no_worse_than_none(clock: Callable[[float], float]) -> None:
    """It stands still, runs backwards, begins anew, goes slowly, counts milliseconds, jumps."""
    packets = [(arrived, made, clock(made)) for arrived, made, _ in sent(60.0)]
    x = np.array([frame.root_pos[0] for frame in played(packets, 60.0)])
    known = steps(60.0) > 3.0
    np.testing.assert_allclose(x[known], V * steps(60.0)[known], atol=0.03)


@pytest.mark.parametrize("stamped", [True, False])
def test_two_packets_at_once(stamped: bool) -> None:
    """Every fourth pose comes with the next one, or in two packets."""
    late = [
        (made + 1 / 60 - 1e-4 if k % 4 == 0 else made, made, stamp)
        for k, (_, made, stamp) in enumerate(sent(60.0, stamped=stamped))
    ]
    twice = [p for a, made, stamp in sent(60.0) for p in ((a, made, stamp), (a + 1e-4, made, None))]
    for packets in (late, twice):
        moved = speeds(played(packets, 60.0), 60.0)
        np.testing.assert_allclose(moved, 1.0, atol=0.15)


@pytest.mark.parametrize("silent", [0.0, 1.0])
def test_there_is_no_way_to_another_unit(silent: float) -> None:
    """Of a sender who changes to centimetres, after a stall or in the middle of a walk, every step
    gets a pose that was sent: one between the two would be in feet."""
    buffer, heights = JitterBuffer(), []
    packets = [each for each in sent(40.0) if not 3.0 < each[1] < 3.0 + silent]
    for now in steps(60.0).tolist():
        while packets and packets[0][0] <= now:
            arrived, made, stamp = packets.pop(0)
            frame = pose(made)
            unit = 1.0 if made < 3.0 else 100.0
            buffer.put(frame._replace(root_pos=frame.root_pos * [1.0, 1.0, unit]), arrived, stamp)
        heights.append(float(buffer.get(now).root_pos[2]))
    np.testing.assert_allclose(np.unique(np.round(heights, 9)), [1.0, 100.0])
