"""A process that dies takes its own job with it, and nothing else."""

import os
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import pytest

from spark_sim.shelf.processes import Died, in_processes
from tests.helpers.program import CHECKOUT


def square(number: int) -> int:
    return number * number


def threads(_: int) -> str | None:
    return os.environ.get("OPENBLAS_NUM_THREADS")


def die_at_three(folder: Path, always: bool, number: int) -> int:
    if number == 3 and (always or not (folder / "tried").exists()):
        (folder / "tried").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def test_every_job_is_done_once_on_one_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "7")
    assert sorted(in_processes(square, range(10), 2)) == [(k, k * k) for k in range(10)]
    assert list(in_processes(threads, [0], 2)) == [(0, "1")]
    assert os.environ["OPENBLAS_NUM_THREADS"] == "7"
    assert list(in_processes(square, [], 2)) == []


def test_jobs_are_taken_as_they_are_needed() -> None:
    taken: list[int] = []

    def jobs() -> Iterator[int]:
        for k in range(20):
            taken.append(k)
            yield k

    found = in_processes(square, jobs(), 2)
    next(found)
    assert len(taken) <= 4
    found.close()


@pytest.mark.parametrize("always", [False, True])
def test_a_killed_process_is_replaced(tmp_path: Path, always: bool) -> None:
    """Its job is tried once more, and then given up; the others are done."""
    done = dict(in_processes(partial(die_at_three, tmp_path, always), range(6), 2))
    died = done.pop(3)
    assert done == {k: k * k for k in (0, 1, 2, 4, 5)}
    if always:
        assert died == Died(-signal.SIGKILL)
        assert "SIGKILL" in str(died)
    else:
        assert died == 9


def die_amid_the_answer(folder: Path, number: int) -> int:
    if number == 3 and not (folder / "tried").exists():
        (folder / "tried").touch()
        pipe = sys._getframe(1).f_locals["pipe"]
        os.write(pipe.fileno(), struct.pack("!i", 1000) + b"the first of a thousand bytes")
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def end_the_server(folder: Path, number: int) -> int:
    if number == 3 and not (folder / "tried").exists():
        (folder / "tried").touch()
        os.kill(os.getppid(), signal.SIGKILL)
    return number * number


@pytest.mark.parametrize("fault", [die_amid_the_answer, end_the_server])
def test_neither_half_an_answer_nor_a_lost_server_of_forks_stops_the_others(
    tmp_path: Path, fault: Callable[[Path, int], int]
) -> None:
    done = dict(in_processes(partial(fault, tmp_path), range(8), 2))
    assert done == {k: k * k for k in range(8)}
    assert (tmp_path / "tried").exists()


def stop_at_zero(folder: Path, number: int) -> int:
    told = folder / "stopped"
    if number == 0:
        part = folder / "part"
        part.write_text(str(os.getpid()))
        part.rename(told)
        os.kill(os.getpid(), signal.SIGSTOP)
    while not told.exists():
        time.sleep(0.01)
    return number


def test_a_stopped_process_is_ended(tmp_path: Path) -> None:
    found = in_processes(partial(stop_at_zero, tmp_path), range(4), 2)
    assert next(found) == (1, 1)
    found.close()
    assert not Path("/proc", (tmp_path / "stopped").read_text()).exists()


_PARENT = """
import sys, time
from pathlib import Path
from spark_sim.shelf.processes import in_processes
from tests.spark_sim.shelf.test_processes import busy_for_long
list(in_processes(busy_for_long, [Path(name) for name in sys.argv[1:]], 2))
"""


def busy_for_long(told: Path) -> None:
    told.write_text(str(os.getpid()))
    end = time.monotonic() + 300
    while time.monotonic() < end:
        pass


def test_processes_end_amid_a_job_with_the_one_that_gave_it(tmp_path: Path) -> None:
    told = [tmp_path / "one", tmp_path / "other"]
    process = subprocess.Popen(
        [sys.executable, "-c", _PARENT, *map(str, told)],
        env=os.environ | {"PYTHONPATH": str(CHECKOUT)},
    )
    deadline = time.monotonic() + 60
    while not all(path.exists() and path.read_text() for path in told):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.02)
    process.kill()
    process.wait()
    workers = {Path("/proc", path.read_text()) for path in told}
    deadline = time.monotonic() + 30  # they would be busy for ten times as long
    while left := {path for path in workers if path.exists()}:
        assert time.monotonic() < deadline, left
        time.sleep(0.02)


_STARTING = """
import time
from multiprocessing import forkserver
from spark_sim.shelf.processes import begin
begin()
print(forkserver._forkserver._forkserver_pid, flush=True)
time.sleep(300)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="there are no servers of forks elsewhere")
def test_a_server_of_forks_ends_while_it_still_imports() -> None:
    process = subprocess.Popen(
        [sys.executable, "-c", _STARTING],
        env=os.environ | {"PYTHONPATH": str(CHECKOUT)},
        stdout=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    server = int(process.stdout.readline())
    try:
        deadline = time.monotonic() + 60
        # It is stopped amid its imports: by itself it would never see that it is alone.
        while "numpy" not in Path(f"/proc/{server}/maps").read_text():
            assert time.monotonic() < deadline
            time.sleep(0.005)
        os.kill(server, signal.SIGSTOP)
    finally:
        process.kill()
        process.communicate()
    deadline = time.monotonic() + 30
    while (state := _state(server)) not in ("", "Z", "X"):
        assert time.monotonic() < deadline, state
        time.sleep(0.02)


def _state(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return ""
