"""A batch makes what is missing or changed, whenever it was killed."""

import os
import random
from multiprocessing import get_context
from pathlib import Path

import pytest

from spark_sim.shelf import batch
from spark_sim.shelf.keep import parse
from spark_sim.shelf.manifest import Manifest
from spark_sim.shelf.work import work
from tests.helpers import shelf

KILLS = 50


@pytest.fixture(autouse=True)
def _real_work(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(batch, "work", work)  # what `shelf.run` replaces comes back


def sources(folder: Path, **texts: str) -> Path:
    folder.mkdir(exist_ok=True)
    for name, text in texts.items():
        (folder / f"{name}.bvh").write_text(text)
    return folder


def whole(folder: Path) -> dict[str, bytes]:
    """What the results of a folder's sources must be."""
    out = {}
    for path in folder.iterdir():
        text = path.read_text()
        if text == "broken":
            continue
        count = int(text.split()[0])
        for k in range(count):
            suffix = f"_cut{k:02}" if count > 1 else ""
            out[f"robot/{path.stem}{suffix}.npz"] = shelf.contents(text, k)
    return out


def test_only_what_is_missing_or_changed_is_made(tmp_path: Path) -> None:
    folder, out = sources(tmp_path / "in", a="1 a", b="2 b", c="broken"), tmp_path / "out"
    first = shelf.run(folder, out)
    assert (first.written, first.unchanged, first.failed) == (3, 0, 1)
    assert shelf.results(out) == whole(folder)
    stamps = {path: path.stat().st_mtime_ns for path in (out / "robot").iterdir()}

    again = shelf.run(folder, out)
    assert (again.written, again.unchanged, again.failed) == (0, 3, 1)
    assert {path: path.stat().st_mtime_ns for path in (out / "robot").iterdir()} == stamps
    assert again.sentence() == f"3 unchanged, 1 failed: {folder}/c.bvh: is broken"

    os.utime(folder / "a.bvh")  # another time and the same bytes
    assert shelf.run(folder, out).written == 0
    (out / "robot" / "a.npz").write_bytes(b"damaged")
    (out / "robot" / "b_cut01.npz").unlink()
    assert shelf.run(folder, out).written == 3
    assert shelf.results(out) == whole(folder)

    sources(folder, a="1 changed", c="1 mended")
    third = shelf.run(folder, out)
    assert (third.written, third.unchanged, third.failed) == (2, 2, 0)
    assert shelf.results(out) == whole(folder)


def test_pieces_that_are_no_longer_made_go(tmp_path: Path) -> None:
    folder, out = sources(tmp_path / "in", a="3 a"), tmp_path / "out"
    shelf.run(folder, out)
    sources(folder, a="1 a")
    shelf.run(folder, out)
    assert shelf.results(out) == whole(folder)
    sources(folder, a="broken")
    assert shelf.run(folder, out).failed == 1
    assert list(shelf.results(out)) == ["robot/a.npz"]  # what was made before stays
    sources(folder, a="2 a")
    assert shelf.run(folder, out).failed == 0
    assert shelf.results(out) == whole(folder)


def test_files_of_the_user_are_not_overwritten(tmp_path: Path) -> None:
    folder, out = sources(tmp_path / "in", a="1 a", b="1 b"), tmp_path / "out"
    (out / "robot").mkdir(parents=True)
    (out / "robot" / "a.npz").write_bytes(b"mine")
    for _ in range(2):
        tally = shelf.run(folder, out)
        assert tally.failed == 1
        assert "exists, and this batch did not write it" in tally.sentence()
        assert (out / "robot" / "a.npz").read_bytes() == b"mine"
    assert shelf.run(folder, out, force=True).failed == 0
    assert shelf.results(out) == whole(folder)


def test_what_is_kept_is_decided_anew(tmp_path: Path) -> None:
    """Each piece is implausible in a tenth of its number."""
    folder, out = sources(tmp_path / "in", a="4 a"), tmp_path / "out"

    def kept(condition: str | None) -> tuple[list[str], int]:
        keep = None if condition is None else parse(condition)
        tally = shelf.run(folder, out, keep=keep)
        return [Path(name).stem for name in shelf.results(out)], tally.written

    assert kept("implausible < 15%") == (["a_cut00", "a_cut01"], 2)
    assert kept("implausible < 15%") == (["a_cut00", "a_cut01"], 0)
    assert kept("implausible < 5%") == (["a_cut00"], 0)
    assert len(shelf.lines(out)) == 4
    assert kept(None)[0] == ["a_cut00", "a_cut01", "a_cut02", "a_cut03"]
    assert shelf.results(out) == whole(folder)


def test_killed_at_random_moments_it_resumes_to_the_same_bytes(tmp_path: Path) -> None:
    """Between kills the sources change, so that results are replaced and pieces go."""
    rng = random.Random(0)
    folder, out = tmp_path / "in", tmp_path / "out"
    versions = [
        {name: f"{rng.randint(1, 3)} {name}{version}" for name in "abcdef"} for version in range(3)
    ]
    allowed: dict[str, set[bytes]] = {}
    for version in versions:
        for name, data in whole(sources(folder, **version)).items():
            allowed.setdefault(name, set()).add(data)
    context, killed = get_context("forkserver"), 0
    context.set_forkserver_preload(["tests.helpers.shelf"])
    for kill in range(KILLS):
        if kill % 7 == 0:
            sources(folder, **versions[kill // 7 % 3])
        process = context.Process(target=shelf.run, args=(folder, out))
        process.start()
        process.join(rng.uniform(0.0, 0.12))
        process.kill()
        process.join()
        killed += process.exitcode != 0
        if not (out / "robot").exists():
            continue
        claimed = {entry["output"] for entry in Manifest(out)}
        for name, data in shelf.results(out).items():
            assert data in allowed[name], f"{name} is torn after kill {kill}"
            assert name in claimed, f"{name} is nobody's after kill {kill}"
    assert killed > KILLS / 4  # or nothing was tried
    shelf.run(folder, out)
    assert shelf.results(out) == whole(folder)
    assert {path.name for path in out.iterdir()} == {"robot", "manifest.jsonl", ".spark-sim.lock"}
    shelf.run(folder, tmp_path / "undisturbed")
    assert shelf.lines(out) == shelf.lines(tmp_path / "undisturbed")


def test_a_torn_last_line_is_dropped(tmp_path: Path) -> None:
    folder, out = sources(tmp_path / "in", a="1 a", b="1 b"), tmp_path / "out"
    shelf.run(folder, out)
    manifest = out / "manifest.jsonl"
    expected = shelf.lines(out)
    manifest.write_bytes(manifest.read_bytes()[:-9])
    assert shelf.run(folder, out).failed == 1  # of a result that no line names, none is ours
    (out / "robot" / "b.npz").unlink()
    assert shelf.run(folder, out).written == 1
    assert shelf.lines(out) == expected
