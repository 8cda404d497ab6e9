"""Files of strangers: regular ones, of a size that memory holds, and nothing waits."""

import os
from pathlib import Path

import pytest

from spark.errors import FileFormatError
from spark.opening import check_regular, parse_json, parse_toml, read_bytes, read_text

DEEP = "[" * 100_000


def unusual(folder: Path) -> dict[str, Path]:
    """What a name may be of besides a file."""
    made = {name: folder / name for name in ("fifo", "link to zero", "folder", "sparse", "missing")}
    os.mkfifo(made["fifo"])
    made["link to zero"].symlink_to("/dev/zero")
    made["folder"].mkdir()
    with made["sparse"].open("wb") as file:
        file.truncate(1 << 40)
    return made


SAYS = {
    "fifo": "is not a regular file",
    "link to zero": "is not a regular file",
    "folder": "is a folder",
    "sparse": "has 1048576 MB; at most 2048 are read",
    "missing": "no such file",
}


@pytest.mark.parametrize("kind", SAYS)
def test_only_regular_files_are_read(kind: str, tmp_path: Path) -> None:
    path = unusual(tmp_path)[kind]
    for read in (read_bytes, check_regular):
        with pytest.raises(FileFormatError, match=f"{kind}: {SAYS[kind]}"):
            read(path)


def test_what_git_leaves_in_place_of_a_file_is_said_to_be_that(tmp_path: Path) -> None:
    path = tmp_path / "walk.fbx"
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n")
    for read in (read_bytes, check_regular):
        with pytest.raises(FileFormatError, match="git lfs pull"):
            read(path)


def test_names_that_no_file_has() -> None:
    for name in ("a\0b", "x" * 300, "\udcff" * 3):
        with pytest.raises(FileFormatError):
            read_bytes(Path(name))


def test_a_regular_file_is_read_whole(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"\xef\xbb\xbfh\xc3\xa9")
    assert read_bytes(path) == path.read_bytes()
    assert read_text(path) == "hé"
    with pytest.raises(FileFormatError, match="at most 0 are read"):
        read_bytes(path, limit=4)
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(FileFormatError, match="is no text; expected words"):
        read_text(path, expected="words")


@pytest.mark.parametrize("text", [DEEP, f"x = {DEEP}", "x = 1\nx = 2", f"x = {'9' * 5000}"])
def test_no_text_gets_past_the_parsers_untyped(text: str) -> None:
    with pytest.raises(FileFormatError, match="a:"):
        parse_toml(Path("a"), text, "settings")
    with pytest.raises(FileFormatError, match="a: it is no JSON"):
        parse_json(Path("a"), text, "it")


@pytest.mark.parametrize("first", ["0", '"\\udcff"'])  # half a pair, as in names of no text
def test_json_has_finite_numbers_alone(first: str) -> None:
    """Whole ones beyond 64 bits are floats."""
    for digits in (20, 300):
        number = parse_json(Path("a"), f"[{first}, {'9' * digits}]", "it")[1]
        assert number == float("9" * digits)
    for text in ("NaN", "Infinity", "1e999", "9" * 400, "9" * 5000):
        with pytest.raises(FileFormatError, match="no JSON"):
            parse_json(Path("a"), f"[{first}, {text}]", "it")


@pytest.mark.parametrize(
    "text",
    [
        "a" + ".a" * 100_000 + " = 1",
        "[" + "a." * 100_000 + "a]",
        "x = {'a b'" + ' . "b"' * 5000 + "=1}",
    ],
    ids=["key", "table", "quoted"],
)
def test_keys_of_many_names_are_refused_at_once(text: str) -> None:
    """Python's parser takes time with the square of them: minutes for a file of 200 kB."""
    with pytest.raises(FileFormatError, match=r"a:2: nests tables deeper than 100"):
        parse_toml(Path("a"), f"b = 1\n{text}", "settings")


def test_numbers_and_names_of_some_dots_are_read() -> None:
    text = "a.b.c = [" + "1.5, " * 1000 + "]\nd.'e.f' = '" + "a.b " * 99 + "'"
    table = parse_toml(Path("a"), text, "settings")
    assert table["a"]["b"]["c"] == [1.5] * 1000
    assert table["d"] == {"e.f": "a.b " * 99}
