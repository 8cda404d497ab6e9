"""Poses as they come to a port."""

import socket
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import spark_sim
from spark.errors import ConventionError
from spark_sim.live import listener as module
from spark_sim.live import pace
from spark_sim.live.listener import Listener
from tests.helpers import mvn, vmc


@pytest.fixture
def out() -> socket.socket:
    return socket.socket(socket.AF_INET, socket.SOCK_DGRAM)


def test_the_newest_of_several_poses_counts(out: socket.socket) -> None:
    with out, Listener("xsens://127.0.0.1:0") as person:
        for sample in range(8):
            bent = {"Head": Rotation.from_euler("z", 0.1 * sample)}
            packet = mvn.quaternions(mvn.world(bent), sample=sample)
            out.sendto(packet, ("127.0.0.1", person.port))
        began = time.time()
        clip = person.wait(fps=90.0, timeout=10.0)
        assert clip.fps == pytest.approx(90)
        assert began - 1 < person.arrived <= time.time()
        frame = person.frame()
        head = clip.joint_names.index("Head")
        assert frame.rotations[head][3] == pytest.approx(np.sin(0.35), abs=1e-5)
        assert person.skipped == 7
        assert not person.fresh
        assert not person.changed
        live = spark_sim.Retargeter(clip, "robot", fps=90.0)
        assert np.isfinite(live.step(frame)).all()


def test_poses_come_with_their_times(out: socket.socket) -> None:
    """Each of them, in their order: also those that a newer one followed."""
    with out, Listener("vmc://127.0.0.1:0") as person:
        out.sendto(vmc.packet({}, 5.0), ("127.0.0.1", person.port))
        person.wait(fps=60.0, timeout=10.0)
        assert [arrival.clock for arrival in person.arrivals()] == [5.0]
        began = time.monotonic()
        for k in range(3):
            out.sendto(
                vmc.packet({}, 6.0 + k, hips=(0.0, 0.9, 0.1 * k)), ("127.0.0.1", person.port)
            )
            time.sleep(0.02)
        person.listen(0.1)
        came = person.arrivals()
        assert [arrival.clock for arrival in came] == [6.0, 7.0, 8.0]
        x = [arrival.frame.root_pos[0] for arrival in came]
        np.testing.assert_allclose(x, [0.0, 0.1, 0.2], atol=1e-6)
        waited = np.diff([began, *(arrival.came for arrival in came)])
        assert waited[0] > -0.001
        assert waited[1:].min() > 0.019  # not when they were read
        assert person.arrivals() == []
        assert not person.fresh


def test_the_poses_of_another_body_are_not_those_of_this_person(out: socket.socket) -> None:
    with out, Listener("vmc://127.0.0.1:0") as person:
        out.sendto(vmc.packet({}, 1.0), ("127.0.0.1", person.port))
        person.wait(fps=60.0, timeout=10.0)
        person.arrivals()
        for k, size in enumerate((0.6, 0.6, 1.0)):
            out.sendto(vmc.packet({}, 2.0 + k, size=size), ("127.0.0.1", person.port))
            person.listen(0.1)
            assert person.changed == (size != 1.0)
            assert person.frame().root_pos[2] == pytest.approx(0.95, abs=1e-6)
        assert len(person.arrivals()) == 1
        out.sendto(vmc.packet({}, 5.0, size=0.6), ("127.0.0.1", person.port))
        person.listen(0.1)
        person.person(60.0)
        assert person.frame().root_pos[2] == pytest.approx(0.57, abs=1e-6)


@pytest.mark.parametrize("unit", [100.0, 1000.0, 0.01])
def test_nobody_is_so_tall(out: socket.socket, unit: float) -> None:
    with out, Listener("vmc://127.0.0.1:0") as person:
        out.sendto(vmc.packet({}, 1.0, size=unit), ("127.0.0.1", person.port))
        with pytest.raises(ConventionError, match=r"hips are .* m high; .* to metres"):
            person.wait(fps=60.0, timeout=10.0)


def walking(port: int, seconds: float) -> threading.Thread:
    """Sends the time as a place, a hundred times a second, meanwhile."""
    began = time.monotonic()

    def send() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            while (now := time.monotonic() - began) < seconds:
                out.sendto(vmc.packet({}, now, hips=(0.0, 0.95, now)), ("127.0.0.1", port))
                time.sleep(0.01)

    thread = threading.Thread(target=send)
    thread.start()
    return thread


def test_after_a_pause_the_pose_is_not_an_old_one() -> None:
    """While a `Retargeter` is made nobody listens, and a few poses fill the socket."""
    with Listener("vmc://127.0.0.1:0") as person:
        person._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8192)
        began, sender = time.monotonic(), walking(person.port, 2.5)
        person.wait(fps=60.0, timeout=10.0)
        time.sleep(1.0)
        person.listen(0.0)
        late = time.monotonic() - began - person.frame().root_pos[0]
        sender.join()
    assert late < 0.15


def test_frames_come_as_often_as_they_are_asked_for(
    out: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    """However long a step takes; and one that took too long is not made up for."""
    now = 100.0  # [s] of a clock that nothing but this test moves

    def pass_by(seconds: float) -> None:
        nonlocal now
        now += seconds

    with out, Listener("vmc://127.0.0.1:0") as person:
        out.sendto(vmc.packet({}, 1.0), ("127.0.0.1", person.port))
        person.wait(fps=30.0, timeout=10.0)
        monkeypatch.setattr(pace, "time", SimpleNamespace(monotonic=lambda: now))
        monkeypatch.setattr(person, "listen", pass_by)
        came = []
        for _ in person.frames(fps=30.0):
            came.append(now)
            pass_by(0.21 if len(came) == 10 else 0.01)
            if len(came) == 30:
                break
    beats = (np.array(came) - came[0]) * 30.0
    expected = np.arange(30.0)
    expected[10:] += 5  # 0.21 s are 6.3 steps: that of 0.2 s is taken late, and five are left out
    expected[10] += 0.3
    assert_allclose(beats, expected, atol=1e-6)


def test_of_a_flood_the_newest_are_taken(
    out: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "_MOST_WAITING", 16)
    with out, Listener("vmc://127.0.0.1:0") as person:
        for clock in range(50):
            out.sendto(vmc.packet({}, float(clock)), ("127.0.0.1", person.port))
        time.sleep(0.1)
        person.listen(0.0)
        assert person.pose.frames == 16
        assert person.flooded == 34
        assert person.pose.missing == ()


def test_what_is_lacking_is_said(out: socket.socket) -> None:
    with out, Listener("vmc://127.0.0.1:0") as person:
        with pytest.raises(ConventionError, match=r"no person was heard of in 0\.1 s$"):
            person.wait(timeout=0.1)
        with pytest.raises(ConventionError, match="wait"):
            person.frame()
        out.sendto(b"what is this", ("127.0.0.1", person.port))
        with pytest.raises(ConventionError, match="1 packets were none of this protocol"):
            person.wait(timeout=0.1)
        headless = vmc.packet({}, 0.0).replace(b"Head", b"Xead")
        out.sendto(headless, ("127.0.0.1", person.port))
        with pytest.raises(ConventionError, match="not heard of: Head"):
            person.wait(timeout=0.1)


@pytest.mark.parametrize(
    "text",
    ["vmc://localhost", "osc://:39539", "vmc://:x", "39539", "vmc://:39539/path", "xsens://:99999"],
)
def test_addresses_that_are_none(text: str) -> None:
    with pytest.raises(ConventionError, match=r"such as vmc://:39539 or xsens://:9763"):
        Listener(text)


def test_a_port_that_is_taken_is_said() -> None:
    with (
        Listener("vmc://127.0.0.1:0") as person,
        pytest.raises(ConventionError, match="can't be listened on"),
    ):
        Listener(f"vmc://127.0.0.1:{person.port}")
    with pytest.raises(ConventionError, match="can't be listened on"):
        Listener("vmc://no.such.host.invalid:39539")
