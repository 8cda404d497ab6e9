"""Sessions in a thread of their own, and senders of poses on the loopback."""

import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from spark_sim.live.session import Session


@contextmanager
def running(session: Session) -> Iterator[None]:
    """The session takes its steps meanwhile."""
    failed: list[BaseException] = []

    def run() -> None:
        try:
            session.run()
        except BaseException as error:
            failed.append(error)

    runner = threading.Thread(target=run)
    runner.start()
    try:
        yield
    finally:
        session.stopping = True
        runner.join(60)
        if failed:
            raise failed[0]


def send(
    port: int,
    packets: Callable[[int, float], list[bytes]],
    *,
    until: Callable[[], bool],
    every: float = 0.01,
    longest: float = 120.0,
) -> None:
    """Send packets until something is so: `packets` makes those of a step, at its time [s]."""
    began = time.monotonic()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        step = 0
        while not until() and time.monotonic() - began < longest:
            for packet in packets(step, time.monotonic() - began):
                out.sendto(packet, ("127.0.0.1", port))
            step += 1
            time.sleep(every)
    assert until(), "it took too long"
