"""How far long work is, told to a log."""

import pytest

from spark_sim import console


@pytest.fixture
def told(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    lines: list[str] = []
    monkeypatch.setattr(console, "note", lines.append)
    return lines


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [0.0]
    monkeypatch.setattr(console, "monotonic", lambda: now[0])
    return now


def test_what_is_left_is_judged_by_the_share_of_the_work(
    clock: list[float], told: list[str]
) -> None:
    """Two of three files are nine tenths of the work."""
    with console.meter(3, 0, "batch", lines=True) as tell:
        tell(1, {"frames/s": 250.0}, 0.5)  # it tells nothing yet
        clock[0] = 90.0
        tell(2, {"frames/s": 300.0}, 0.9)
        clock[0] = 95.0
        tell(3, {}, 0.999999)
    assert told == [
        "batch: 1 of 3, frames/s 250",
        "batch: 2 of 3, frames/s 300, 10 s left",
        "batch: 3 of 3, frames/s 300",
    ]


def test_a_log_of_many_files_does_not_grow_with_them(clock: list[float], told: list[str]) -> None:
    """A hundred thousand files of a second each: lines come ever more seldom."""
    with console.meter(100_000, 0, "batch", lines=True) as tell:
        for step in range(1, 100_001):
            clock[0] = float(step)
            tell(step, {})
    assert 100 < len(told) < 700
    assert told[1] == "batch: 11 of 100000, 27.8 h left"  # 99,989 seconds
    assert told[-1] == "batch: 100000 of 100000"


def test_files_are_counted_in_a_log_where_reading_them_takes_long(
    clock: list[float], told: list[str]
) -> None:
    for _ in console.progress(range(40), "reading", lines=True):
        clock[0] += 0.2
    assert told == []  # 8 s: short work
    for _ in console.progress(range(40), "reading", lines=True):
        clock[0] += 0.5
    assert told == ["reading: 21 of 40", "reading: 40 of 40"]
