"""Lines of a manifest are found again, whoever writes beside, and however many there are."""

import json
import tracemalloc
from pathlib import Path

import pytest

from spark.errors import FileFormatError
from spark_sim.shelf.manifest import SCHEMA, Entry, Manifest


def line(job: str, finished: int, **more: object) -> Entry:
    return {"schema": SCHEMA, "job": job, "finished": f"2026-{finished:06}", **more}


def written(path: Path, *entries: Entry) -> None:
    with path.open("a") as file:
        file.writelines(json.dumps(entry) + "\n" for entry in entries)


def test_the_latest_lines_of_a_job_count(tmp_path: Path) -> None:
    one, two = (line("b", 2, piece=k) for k in range(2))
    written(tmp_path / "manifest.jsonl", line("b", 1), one, line("a", 1), two, line("a", 0))
    manifest = Manifest(tmp_path)
    assert manifest.of("b") == [one, two]
    assert manifest.of("c") == []
    assert list(manifest) == [line("a", 1), one, two]
    manifest.add([line("a", 3, new=True), line("a", 3, new=False)])
    manifest.tidy(tmp_path / ".part")
    expected = [line("a", 3, new=True), line("a", 3, new=False), one, two]
    text = (tmp_path / "manifest.jsonl").read_text()
    assert [json.loads(each) for each in text.splitlines()] == expected == list(manifest)
    before = (tmp_path / "manifest.jsonl").stat().st_ino
    manifest.tidy(tmp_path / ".part")  # it is in order: left as it is
    assert (tmp_path / "manifest.jsonl").stat().st_ino == before


def test_another_shard_may_put_its_lines_in_order_meanwhile(tmp_path: Path) -> None:
    other = Manifest(tmp_path, "2of2")
    for job in "dcba":
        other.add([line(job, 1)])
    ours = Manifest(tmp_path, "1of2")
    other.add([line("d", 2)])
    other.tidy(tmp_path / ".part")
    assert ours.of("a") == [line("a", 1)]
    assert ours.of("d") == [line("d", 2)]
    (tmp_path / "manifest-2of2.jsonl").unlink()
    assert ours.of("b") == []


def test_names_that_are_no_text(tmp_path: Path) -> None:
    entry = line("walk\udcff.npz", 1, source="walk\udcff.bvh")
    manifest = Manifest(tmp_path)
    manifest.add([entry, line("walk\udcff.npz", 1)])
    assert Manifest(tmp_path).of("walk\udcff.npz")[0] == entry


@pytest.mark.parametrize(("text", "says"), [("{", "no line of JSON"), ("[1]", "no entry of")])
def test_what_is_no_line_is_refused(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "manifest.jsonl"
    written(path, line("a", 1))
    with path.open("a") as file:
        file.write(f"{text}\n")
    with pytest.raises(FileFormatError, match=rf"manifest.jsonl:2: .*{says}"):
        Manifest(tmp_path)


def test_memory_does_not_hold_what_lines_say(tmp_path: Path) -> None:
    count, size = 2000, 3000
    written(
        tmp_path / "manifest.jsonl",
        *(line(f"{k:04}", 1, notes="x" * size) for k in reversed(range(count))),
    )
    tracemalloc.start()
    try:
        manifest = Manifest(tmp_path)
        manifest.tidy(tmp_path / ".part")
        assert sum(len(entry["notes"]) for entry in manifest) == count * size
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < count * size / 3
