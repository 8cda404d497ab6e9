"""How many threads a training step takes on a CPU."""

import os
from pathlib import Path

from spark.training.processes import process_count

_SMALL = 64  # networks narrower than this gain nothing from a second thread (docs/training.md)
_QUOTA = Path("/sys/fs/cgroup/cpu.max")  # of a container: microseconds of CPU time in a period


def choose_threads(width: int) -> int | None:
    """Threads for a network of `width` features: one a core that is free, and one for a small
    network. None where `OMP_NUM_THREADS` or `torchrun` has chosen."""
    if "OMP_NUM_THREADS" in os.environ or process_count() > 1:
        return None
    return 1 if width < _SMALL else free_cores()


def free_cores() -> int:
    """Cores that this process may use and that others have left idle for the last minute, at least
    one. Threads that wait for a core make all others wait: it is worse to take too many."""
    may_use = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    cores = min(may_use or 1, _quota())
    busy = round(os.getloadavg()[0]) if hasattr(os, "getloadavg") else 0
    return max(1, cores - max(0, busy - max(0, (os.cpu_count() or 1) - cores)))


def _quota() -> int:
    """The cores' worth of time that a container gives; many where there is no limit."""
    try:
        time, period = _QUOTA.read_text().split()
        return max(1, int(time) // int(period))
    except (OSError, ValueError):  # no such file, or "max"
        return 1 << 16
