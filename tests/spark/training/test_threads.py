"""How many threads a step takes: no more than are free."""

import os
from pathlib import Path

import pytest

from spark.training import threads


@pytest.mark.parametrize(
    ("cores", "load", "quota", "expected"),
    [
        (8, 0.2, "max 100000", 8),
        (8, 5.1, "max 100000", 3),
        (2, 9.0, "max 100000", 1),
        (64, 0.0, "200000 100000", 2),  # a container with two cores' time
        (64, 40.0, "200000 100000", 2),  # which others' work elsewhere does not touch
        (4, 0.0, "50000 100000", 1),
        (4, 0.0, None, 4),
    ],
)
def test_threads_are_the_cores_that_are_free(
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    cores: int,
    load: float,
    quota: str | None,
    expected: int,
) -> None:
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: set(range(cores)), raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: cores)
    monkeypatch.setattr(os, "getloadavg", lambda: (load, load, load))
    file = tmp_path / "cpu.max"
    if quota:
        file.write_text(quota + "\n")
    monkeypatch.setattr(threads, "_QUOTA", file)
    assert threads.choose_threads(128) == expected
    assert threads.choose_threads(48) == 1
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    assert threads.choose_threads(128) is None
