"""One run at a time in a folder, where the system can see to it."""

import errno
import os
from pathlib import Path

import pytest

from spark import files
from spark.errors import OutputError
from spark_sim.files import one_run


def test_one_run_at_a_time(tmp_path: Path) -> None:
    with (
        one_run(tmp_path),
        one_run(tmp_path, "1of2"),
        pytest.raises(OutputError, match="another run is writing to it"),
        one_run(tmp_path, "1of2"),
    ):
        pass


def lock_nothing(monkeypatch: pytest.MonkeyPatch, number: int) -> None:
    def fail(_: int) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(files, "_lock", fail)


def test_a_system_that_locks_nothing_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    lock_nothing(monkeypatch, errno.ENOLCK)
    with one_run(tmp_path):
        assert "start one run in it alone" in capfd.readouterr().err


def test_what_else_fails_is_no_lock(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lock_nothing(monkeypatch, errno.EIO)
    with pytest.raises(OSError, match="Input/output error"), one_run(tmp_path):
        pass
