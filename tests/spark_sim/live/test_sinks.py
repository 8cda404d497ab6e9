"""Coordinates as they arrive where they are sent."""

import json
import socket
import struct
import sys
import time

import numpy as np
import pytest
import zmq

from spark.errors import ConventionError, DependencyError
from spark_sim.live.sinks import sink

QPOS = np.array([0.5, -1.0, 0.8, 1.0, 0.0, 0.0, 0.0, 0.25])


def check(data: bytes, layout: str, frame: int) -> None:
    if layout == "json":
        assert json.loads(data) == {"frame": frame, "time": 12.5, "qpos": QPOS.tolist()}
        return
    # As docs/live.md says it.
    assert len(data) == 24 + 8 * len(QPOS)
    assert struct.unpack_from("<4sHHQd", data) == (b"SPRK", 1, len(QPOS), frame, 12.5)
    np.testing.assert_array_equal(np.frombuffer(data, "<f8", offset=24), QPOS)


@pytest.mark.parametrize("layout", ["json", "bytes"])
def test_udp(layout: str) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as receiver:
        receiver.bind(("127.0.0.1", 0))
        receiver.settimeout(10)
        to = sink(f"udp://localhost:{receiver.getsockname()[1]}?{layout}")
        to.send(3, 12.5, QPOS)
        check(receiver.recv(65535), layout, 3)
        to.close()


@pytest.mark.parametrize("layout", ["json", "bytes"])
def test_zmq_publishes_and_pushes(layout: str) -> None:
    with zmq.Context() as context, context.socket(zmq.PULL) as pull:
        port = pull.bind_to_random_port("tcp://127.0.0.1")
        to = sink(f"zmq+push://localhost:{port}?{layout}")
        to.send(4, 12.5, QPOS)
        assert pull.poll(10_000)
        check(pull.recv(), layout, 4)
        to.close()
    free = socket.create_server(("127.0.0.1", 0))
    port = free.getsockname()[1]
    free.close()
    with zmq.Context() as context, context.socket(zmq.SUB) as subscriber:
        to = sink(f"zmq://127.0.0.1:{port}?{layout}")
        subscriber.connect(f"tcp://127.0.0.1:{port}")
        subscriber.setsockopt(zmq.SUBSCRIBE, b"")
        until = time.monotonic() + 20
        while not subscriber.poll(10):  # it takes a moment to subscribe
            assert time.monotonic() < until
            to.send(5, 12.5, QPOS)
        check(subscriber.recv(), layout, 5)
        to.close()


@pytest.mark.parametrize("address", ["zmq+push://localhost:1", "udp://localhost:1"])
def test_a_receiver_that_is_not_there_keeps_no_one_waiting(address: str) -> None:
    to = sink(address)
    began = time.monotonic()
    for frame in range(1000):
        to.send(frame, 12.5, QPOS)
    to.close()
    assert time.monotonic() - began < 10


@pytest.mark.parametrize(
    "text", ["tcp://localhost:9", "udp://:9000", "udp://localhost", "udp://localhost:9?xml"]
)
def test_addresses_that_are_none(text: str) -> None:
    with pytest.raises(ConventionError, match="such as"):
        sink(text)


def test_addresses_that_can_not_be_used() -> None:
    with pytest.raises(ConventionError, match="no host"):
        sink("udp://no.such.host.invalid:9000")
    with (
        socket.create_server(("127.0.0.1", 0)) as taken,
        pytest.raises(ConventionError, match="can't be published on"),
    ):
        sink(f"zmq://127.0.0.1:{taken.getsockname()[1]}")


def test_pyzmq_that_is_missing_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "zmq", None)
    with pytest.raises(DependencyError, match=r"spark-sim\[live\]"):
        sink("zmq://*:5556")
