"""Where a robot's coordinates go: datagrams, or ZeroMQ messages."""

import json
import socket
import struct
from abc import ABC, abstractmethod
from contextlib import suppress
from importlib import import_module
from typing import Any

import numpy as np
from jaxtyping import Float

from spark.errors import ConventionError, DependencyError
from spark_sim.live.address import LAYOUTS, SINKS, Address, parse, resolved

HEADER = struct.Struct("<4sHHQd")
"""What comes before the coordinates in the layout `bytes`: "SPRK", the version, how many
coordinates, the frame, the time [s, Unix]. Little-endian; the coordinates are doubles."""
_MAGIC, _VERSION = b"SPRK", 1
_WAITING = 8  # messages that may wait for a slow receiver; what is older is of no use


class Sink(ABC):
    """Sends coordinates, and never waits: what no one takes is gone."""

    def __init__(self, layout: str) -> None:
        self._layout = layout

    def send(self, frame: int, time: float, qpos: Float[np.ndarray, "nq"]) -> None:
        """Send the coordinates of a frame."""
        self._send(message(frame, time, qpos, self._layout))

    @abstractmethod
    def _send(self, data: bytes) -> None: ...

    @abstractmethod
    def close(self) -> None:
        """Send no more."""


def message(frame: int, time: float, qpos: Float[np.ndarray, "nq"], layout: str) -> bytes:
    """A frame's coordinates in one of `LAYOUTS`."""
    if layout == "json":
        return json.dumps({"frame": frame, "time": time, "qpos": qpos.tolist()}).encode()
    head = HEADER.pack(_MAGIC, _VERSION, len(qpos), frame, time)
    return head + qpos.astype("<f8").tobytes()


class UdpSink(Sink):
    """One datagram a frame."""

    def __init__(self, address: Address) -> None:
        super().__init__(address.layout)
        self._to = resolved(address)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def _send(self, data: bytes) -> None:
        with suppress(OSError):  # no one listens, or the network is away: the next may arrive
            self._socket.sendto(data, self._to)

    def close(self) -> None:
        self._socket.close()


class ZmqSink(Sink):
    """One message of one part a frame: PUB, which others connect to, or PUSH, which connects."""

    def __init__(self, address: Address) -> None:
        super().__init__(address.layout)
        try:
            zmq: Any = import_module("zmq")
        except ImportError as error:
            raise DependencyError("zmq:// needs pyzmq: pip install 'spark-sim[live]'") from error
        self._zmq = zmq
        pushes = address.scheme == "zmq+push"
        if pushes and not address.host:
            raise ConventionError(f"{address}: there is no host to send to, such as localhost")
        self._context = zmq.Context()
        self._socket = self._context.socket(zmq.PUSH if pushes else zmq.PUB)
        self._socket.setsockopt(zmq.SNDHWM, _WAITING)
        self._socket.setsockopt(zmq.LINGER, 200)  # [ms]
        host = address.host or "*"
        try:
            if pushes:
                self._socket.connect(f"tcp://{host}:{address.port}")
            else:
                self._socket.bind(f"tcp://{_number(address, host)}:{address.port}")
        except zmq.ZMQError as error:
            self.close()
            verb = "connected to" if pushes else "published on"
            raise ConventionError(f"{address}: can't be {verb} ({error})") from error

    def _send(self, data: bytes) -> None:
        with suppress(self._zmq.Again):  # as many wait as may
            self._socket.send(data, self._zmq.NOBLOCK)

    def close(self) -> None:
        self._socket.close()
        self._context.term()


def _number(address: Address, host: str) -> str:
    """What ZeroMQ binds to: it takes numbers, not names."""
    return host if host == "*" else resolved(address)[0]


def sink(text: str) -> Sink:
    """What sends to an address of `SINKS`. Raises `ConventionError` where it is none, and
    `DependencyError` where pyzmq is missing."""
    address = parse(text, SINKS, layouts=LAYOUTS)
    return UdpSink(address) if address.scheme == "udp" else ZmqSink(address)
