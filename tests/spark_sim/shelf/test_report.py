"""The report of a folder: what is measured, the tables, and the page in a browser."""

import base64
import csv
import json
import os
import re
import shutil
from pathlib import Path
from urllib.parse import unquote, unquote_to_bytes

import numpy as np
import pytest
from pyarrow import parquet

import spark_sim
from spark_sim.shelf.duplicates import Duplicates
from spark_sim.shelf.headline import key
from spark_sim.shelf.histogram import HEIGHT, histogram
from spark_sim.shelf.items import items
from spark_sim.shelf.overview import overview
from spark_sim.shelf.remembered import Measured
from spark_sim.shelf.tables import COLUMNS
from spark_sim.shelf.thumbnail import BELOW, FOOT, LEFT, MOMENTS, UNIT, thumbnail
from tests.helpers.browser import Elements, opened, with_probe
from tests.helpers.program import Program

EVIL = "<img src=x onerror=alert(1)>"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """`out/` of a batch onto a character, with a motion that sinks and a broken one beside it, and
    the report of it."""
    folder = tmp_path_factory.mktemp("folder")
    spark_sim.sample(folder / "samples")
    (folder / "in").mkdir()
    for name in ("walk", "squat"):
        shutil.copy(folder / "samples" / f"walker_{name}.bvh", folder / "in" / f"{name}.bvh")
    sunk = spark_sim.load(folder / "in" / "squat.bvh").recording.bvh
    text = (folder / "in" / "squat.bvh").read_text()
    head, _, rows = text.partition("Frame Time:")
    first, *lines = rows.strip().splitlines()
    lower = [re.sub(r"^(\S+) (\S+)", lambda m: f"{m[1]} {float(m[2]) - 20}", row) for row in lines]
    assert sunk.values[0, 1] > 50  # the second number is the height in cm
    with Program(folder) as program:
        done = program(
            *("batch", "in", "--to", "samples/dancer_walk.bvh", "-o", "out", "--workers", "1")
        )
        assert done.code == 0, done.stderr
        (folder / "out" / f"{EVIL}.bvh").write_text(
            "\n".join([f"{head}Frame Time: {first}", *lower]) + "\n"
        )
        (folder / "out" / "broken.bvh").write_text("no BVH")
        done = program("report", "out", "--workers", "1")
        assert done.code == 2
        assert "broken.bvh: " in done.stderr
        assert done.stdout.splitlines()[-1] == (
            "out/report.html: 3 motions, 1 could not be measured"
        )
    return folder


def test_the_tables_say_what_the_report_of_each_says(folder: Path) -> None:
    table = json.loads((folder / "out" / "report.json").read_text())
    rows = {row["file"]: row for row in table["clips"]}
    assert set(rows) == {
        "dancer_walk/walk.bvh",
        "dancer_walk/squat.bvh",
        f"{EVIL}.bvh",
        "broken.bvh",
    }
    alone = spark_sim.report(
        folder / "out" / "dancer_walk" / "walk.bvh", source=folder / "in" / "walk.bvh"
    ).json()
    row = rows["dancer_walk/walk.bvh"]
    assert row["implausible_share"] == alone["implausible_share"]
    assert row["skating_share"] == alone["clip"]["flags"]["skating"]["share"]
    assert row["root_drift_m"] == pytest.approx(alone["root_drift"]["largest_m"])
    assert rows["broken.bvh"]["error"]

    with (folder / "out" / "report.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert tuple(lines[0]) == COLUMNS
    typed = parquet.read_table(folder / "out" / "report.parquet").to_pylist()
    for name in ("frames", "fps", "implausible_share", "root_drift_m", "balance_share"):
        for line, row_typed in zip(lines, typed, strict=True):
            value = rows[line["file"]].get(name)
            assert row_typed[name] == value
            assert (float(line[name]) if line[name] else None) == value


def test_each_motion_has_its_own_page(folder: Path, tmp_path: Path) -> None:
    text = (folder / "out" / "report.html").read_text()
    script = """document.body.dataset.result = JSON.stringify(
      [...document.querySelectorAll("#clips a")].map(a => a.getAttribute("href")))"""
    links = set(opened(with_probe(text, script), tmp_path))
    assert len(links) == 3
    for link in links:
        assert "of the frames are implausible" in (folder / "out" / unquote(link)).read_text()


def test_the_page_sorts_in_a_browser(folder: Path, tmp_path: Path) -> None:
    """The worst first; then by name; a strange name is text."""
    text = (folder / "out" / "report.html").read_text()
    tags = Elements(text).tags
    assert not any("onerror" in attributes for _, attributes in tags)
    script = """{
      const column = k => [...document.querySelectorAll("#clips tbody tr")].map(
        row => (row.cells[k].querySelector("a") ?? row.cells[k]).textContent);
      const names = () => column(1), values = () => column(3).map(Number);
      const out = { first: names(), worst: values() };
      document.querySelector("th button[data-column='1']").click(); out.byName = names();
      const head = document.querySelector("th button[data-column='3']");
      head.click(); out.worstAgain = values(); head.click(); out.best = values();
      out.pictures = document.querySelectorAll("#clips tbody svg path.pose").length;
      out.bars = document.querySelectorAll("figure rect").length;
      const filter = document.getElementById("filter");
      filter.value = "WALK.bvh dancer"; filter.oninput();
      setTimeout(() => {
        out.filtered = names(); out.count = document.getElementById("count").textContent;
        document.body.dataset.result = JSON.stringify(out);
      }, 400); }"""
    seen = opened(with_probe(text, script), tmp_path)
    assert seen["worst"] == sorted(seen["worst"], reverse=True)
    assert seen["first"][0] == f"{EVIL}.bvh"
    assert seen["byName"] == sorted(seen["first"])
    assert seen["worstAgain"] == seen["worst"]
    assert seen["best"] == seen["worst"][::-1]
    assert seen["pictures"] >= 3 * 4
    assert seen["bars"] > 10
    assert seen["filtered"] == ["dancer_walk/walk.bvh"]
    assert seen["count"] == "1 of 3 motions"


def pages(out: Path) -> dict[str, int]:
    """The inode of each motion's page, which is another one once the page is written anew."""
    clips = out / "report_clips"
    return {p.relative_to(clips).as_posix(): p.stat().st_ino for p in clips.rglob("*.html")}


def test_a_second_run_measures_what_changed(folder: Path, tmp_path: Path) -> None:
    shutil.copytree(folder / "out", tmp_path / "out")
    shutil.copytree(folder / "in", tmp_path / "in")
    out = tmp_path / "out"
    before = pages(out)
    with Program(tmp_path) as program:

        def again() -> set[str]:
            """The pages that a run writes anew, or for the first time."""
            nonlocal before
            old, done = before, program("report", "out", "--workers", "1")
            assert done.code == 2, done.stderr  # of the broken one
            before = pages(out)
            return {name for name, inode in before.items() if old.get(name) != inode}

        again()  # the folder was copied: sources lie elsewhere now
        table = (out / "report.json").read_bytes()
        assert again() == set()
        assert (out / "report.json").read_bytes() == table
        for changed, name in {
            tmp_path / "in" / "walk.bvh": "dancer_walk/walk.bvh",
            out / "report_clips" / "dancer_walk" / "squat.bvh.html": "dancer_walk/squat.bvh",
            out / f"{EVIL}.bvh": f"{EVIL}.bvh",
        }.items():
            changed.write_text(changed.read_text() + "\n")
            assert again() == {f"{name}.html"}
        (out / "dancer_walk" / "squat.bvh").unlink()
        mine = out / "report_clips" / "mine.html"
        mine.write_text("mine")
        assert again() == {"mine.html"}
        assert "dancer_walk/squat.bvh.html" not in before  # nor is there a page of what is gone
        one = out / "report_clips" / "dancer_walk" / "walk.bvh.json"
        one.write_text(one.read_text()[:-20])  # torn, as no kill leaves it
        assert again() == {"dancer_walk/walk.bvh.html"}


def test_nothing_is_overwritten_unasked(folder: Path) -> None:
    with Program(folder) as program:
        table = folder / "out" / "report.csv"
        ours = table.read_bytes()
        table.write_text("mine")
        done = program("report", "out")
        assert done.code == 2
        assert "report.csv: exists" in done.stderr
        assert table.read_text() == "mine"
        table.write_bytes(ours)
        (folder / "mine_clips").mkdir(exist_ok=True)
        done = program("report", "out", "--html", "mine.html")
        assert "mine_clips: exists" in done.stderr
        done = program("report", "in/walk.bvh", "--html", "out/report.html")
        assert done.code == 2
        done = program("report", "samples", "--html", "out.txt")
        assert "is written as" in done.stderr


def test_sources_are_found_by_name(tmp_path: Path) -> None:
    for name in ("out/sub/walk_on_g1.bvh", "out/jump.bvh", "mocap/sub/walk.bvh", "mocap/jump.bvh"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    found = items(tmp_path / "out", {}, tmp_path / "mocap", {})
    origins = {item.name: item.origin and item.origin.path for item in found}
    assert origins == {
        "jump.bvh": tmp_path / "mocap" / "jump.bvh",
        "sub/walk_on_g1.bvh": tmp_path / "mocap" / "sub" / "walk.bvh",
    }
    one = items(tmp_path / "out", {}, tmp_path / "mocap" / "jump.bvh", {})
    assert {item.origin.path.name for item in one if item.origin} == {"jump.bvh"}
    assert all(item.origin is None for item in items(tmp_path / "out", {}, None, {}))


def test_bars_stand_for_every_value() -> None:
    values = [0.0] * 90 + [5.0] * 9 + [50.0]
    made = histogram(values)
    counts = [int(re.search(r": (\d+);", bar["words"])[1]) for bar in made["bars"]]
    assert counts == [90, 9, 1]
    shares = [float(re.search(r"; (\S+) %", bar["words"])[1]) for bar in made["bars"]]
    assert shares == [90, 99, 100]
    assert made["bars"][0]["height"] == HEIGHT
    assert made["bars"][-1]["height"] == pytest.approx(HEIGHT / np.sqrt(90), abs=0.01)
    assert made["median"] == "0"
    assert histogram([])["bars"] == []


def test_a_motion_in_several_formats_is_counted_once(folder: Path, tmp_path: Path) -> None:
    """By the files that were made last."""
    shutil.copytree(folder / "in", tmp_path / "in")
    with Program(tmp_path) as program:
        batch = ("batch", "in", "--to", "robot", "-o", "out", "--method", "copy", "--workers", "1")
        assert program(*batch, "--format", "csv").code == 0
        assert program(*batch, "--format", "mjlab", "--cut", "2s").code == 0
        done = program("report", "out", "--json", "--workers", "1")
    files = [clip["file"] for clip in json.loads(done.stdout)["clips"]]
    cut = {f"robot/{path.name}" for path in (tmp_path / "out" / "robot").glob("*_cut*.npz")}
    assert len(cut) > 2
    assert sorted(files) == sorted(cut)
    assert len(list((tmp_path / "out" / "robot").glob("*.csv"))) == 2


def test_a_name_that_is_no_text_is_found(tmp_path: Path) -> None:
    """The link to the page of a motion leads to its file, whatever bytes its name has."""
    name = os.fsdecode(b"w\xffalk #1?%.bvh")
    facts = {"file": name, "duration_s": 1.0, "worst": None, key("implausible"): 0.5}
    picture = {"bones": [[0, 1]], "points": "AAAAAAAAAAAAAAAAAAAAAAAAAAA=", "worst": 0}
    text = overview("t", [Measured(name, facts, picture)], [], Duplicates([], []), ["", ""], "c d")
    script = """
      const href = document.querySelector("td a").href;
      document.body.replaceChildren();  // the browser can't write a name that is no text
      document.body.dataset.result = JSON.stringify(href);"""
    href = opened(with_probe(text, script), tmp_path)
    assert unquote_to_bytes(href).endswith(b"/c d/" + os.fsencode(name) + b".html")


def test_a_drawing_is_of_the_body(tmp_path: Path) -> None:
    """Each figure stands on the floor, as tall as the picture allows, and on its middle."""
    clip, drawn = spark_sim.load(spark_sim.sample(tmp_path)[0]), 72
    made = thumbnail(clip.motion, clip.rig, clip.floor_z, 3, marked=True)
    count = sum(role is not None for role in clip.rig.roles.roles)
    points = np.frombuffer(base64.b64decode(made["points"]), np.uint8).reshape(MOMENTS, count, 2)
    x, y = np.moveaxis(points * UNIT + [LEFT, BELOW], -1, 0)
    assert np.abs(y.min(axis=1)).max() < 8
    assert y.max() == pytest.approx((drawn - FOOT) / 1.15, abs=10)
    assert np.abs(x.mean(axis=1)).max() < 6
    assert made["worst"] == 0
    assert {child for _, child in made["bones"]} | {0} == set(range(count))
