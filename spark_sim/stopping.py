"""Ctrl-C during work that can be gone on with: asked once, it ends at the next good moment."""

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")


@contextmanager
def asked_to_stop(tell: Callable[[], None]) -> Iterator[Callable[[], int]]:
    """A function that gives the number of the signal that asked this process to end, 0 where none
    did. `tell` is called at the first one; the second ends the process as it did before."""
    asked = 0
    before = {
        number: signal.getsignal(number)
        for name in _SIGNALS
        if (number := getattr(signal, name, None)) is not None
    }

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    def ask(number: int, frame: object) -> None:
        nonlocal asked
        asked = number
        restore()
        tell()

    for number in before:
        signal.signal(number, ask)
    try:
        yield lambda: asked
    finally:
        restore()
