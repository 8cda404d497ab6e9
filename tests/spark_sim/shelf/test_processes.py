"""A process that dies takes its own job with it, and nothing else."""

import os
import signal
from functools import partial
from pathlib import Path

import pytest

from spark_sim.shelf.processes import Died, in_processes


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

    def jobs() -> object:
        for k in range(20):
            taken.append(k)
            yield k

    found = in_processes(square, jobs(), 2)  # type: ignore[arg-type]
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
