"""Files written whole or not at all."""

import os
import stat
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from spark.errors import OutputError
from spark.files import alone, replacing, write_atomically


def test_new_bytes_or_the_old_ones(tmp_path: Path) -> None:
    path = tmp_path / "file"
    write_atomically(path, b"old")

    def pieces() -> Iterator[bytes]:
        yield b"new, "
        assert path.read_bytes() == b"old"
        if broken:
            raise KeyboardInterrupt
        yield b"whole"

    broken = True
    with pytest.raises(KeyboardInterrupt):
        write_atomically(path, pieces())
    assert path.read_bytes() == b"old"
    broken = False
    write_atomically(path, pieces())
    assert path.read_bytes() == b"new, whole"
    assert os.listdir(tmp_path) == ["file"]


def test_a_link_stays_one(tmp_path: Path) -> None:
    (tmp_path / "far").mkdir()
    file, link = tmp_path / "far" / "file", tmp_path / "link"
    file.write_bytes(b"old")
    file.chmod(0o640)
    link.symlink_to(file)
    write_atomically(link, b"new")
    assert link.is_symlink()
    assert file.read_bytes() == b"new"
    assert stat.S_IMODE(file.stat().st_mode) == 0o640
    assert not any(path.name.startswith(".") for path in tmp_path.rglob("*"))
    # A link to nothing yet makes the file; links in a circle can't.
    link.unlink()
    link.symlink_to(tmp_path / "far" / "other")
    write_atomically(link, b"new")
    assert (tmp_path / "far" / "other").read_bytes() == b"new"
    one, two = tmp_path / "one", tmp_path / "two"
    one.symlink_to(two)
    two.symlink_to(one)
    with pytest.raises(OutputError, match="one: can't be written"):
        write_atomically(one, b"new")


def test_the_longest_name_that_fits(tmp_path: Path) -> None:
    path = tmp_path / ("x" * 251 + ".bvh")
    write_atomically(path, b"new")
    assert path.read_bytes() == b"new"
    with pytest.raises(OutputError, match="can't be written"):
        write_atomically(tmp_path / ("x" * 256), b"new")


def test_errors_name_the_file(tmp_path: Path) -> None:
    for path in (tmp_path / "no" / "file", tmp_path / "a\0b", Path("/dev/full")):
        with pytest.raises(OutputError, match="can't be written"):
            write_atomically(path, b"new")
    with pytest.raises(OutputError, match="make room there"):
        write_atomically(Path("/dev/full"), b"new")
    (tmp_path / "folder").mkdir()
    with pytest.raises(OutputError, match="folder: can't be written"):
        write_atomically(tmp_path / "folder", b"new")
    assert os.listdir(tmp_path) == ["folder"]


def test_a_pipe_takes_the_data(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    read: list[bytes] = []
    reader = threading.Thread(target=lambda: read.append(pipe.read_bytes()))
    reader.start()
    write_atomically(pipe, b"new")
    reader.join()
    assert read == [b"new"]
    assert stat.S_ISFIFO(pipe.stat().st_mode)


def test_writers_at_once_do_not_meet(tmp_path: Path) -> None:
    path = tmp_path / "file"
    with replacing(path) as one, replacing(path) as two:
        assert one != two
        one.write_bytes(b"one")
        two.write_bytes(b"two")
    assert path.read_bytes() == b"one"


def test_alone(tmp_path: Path) -> None:
    with alone(tmp_path / "new"):
        with pytest.raises(OutputError, match="another run"), alone(tmp_path / "new"):
            pass
        with alone(tmp_path / "other"), alone(tmp_path / "new", "1of2"):
            pass
    with alone(tmp_path / "new"):
        pass
