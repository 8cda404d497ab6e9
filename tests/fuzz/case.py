"""One spoilt file: what may come of it, within which bounds."""

import resource
import signal
import sys
from pathlib import Path

from spark.errors import SparkSimError
from tests.fuzz.target import Target

SECONDS = 5.0  # of the processor
MEMORY = 300e6  # bytes, and ten times the file


class OverBoundError(AssertionError):
    """A file took more time or memory than one of its size may."""


def judge(target: Target, path: Path) -> None:
    """Use the file at `path`: it gives a result, or an error of ours. Raises what else comes of
    it: an untyped error, `AssertionError` for nonsense, `OverBoundError`."""
    size, before = path.stat().st_size, start_of_memory()
    judge_but_memory(target, path)
    taken = memory_since(before)
    if taken > MEMORY + 10 * size:
        raise OverBoundError(f"{taken / 1e6:.0f} MB for {size / 1e6:.3f} MB")


def judge_but_memory(target: Target, path: Path) -> None:
    """As `judge`, for many files whose memory is looked at together."""
    signal.signal(signal.SIGPROF, _too_long)
    signal.setitimer(signal.ITIMER_PROF, SECONDS)
    try:
        target.use(path)
    except SparkSimError:
        pass
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


def start_of_memory() -> float:
    """What `memory_since` counts from [bytes]."""
    _restart_peak()
    return _peak()


def memory_since(start: float) -> float:
    """The most memory [bytes] that was taken since `start_of_memory`."""
    return _peak() - start


def _too_long(number: int, frame: object) -> None:
    raise OverBoundError(f"more than {SECONDS:g} s")


def _restart_peak() -> None:
    if sys.platform == "linux":
        Path("/proc/self/clear_refs").write_text("5")


def _peak() -> float:
    """The most memory [bytes] that this process has had, on Linux since `_restart_peak`."""
    if sys.platform != "linux":
        return 1024.0 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    status = Path("/proc/self/status").read_text()
    line = next(line for line in status.splitlines() if line.startswith("VmHWM"))
    return 1024.0 * int(line.split()[1])
