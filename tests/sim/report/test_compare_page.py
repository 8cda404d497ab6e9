"""The page of several reports: the numbers of each, one replay, and what to mend."""

import re
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from sim.report import Report, Subject, assess
from sim.report.compare_page import compare_page
from tests.helpers.browser import STILL_REPLAY, Elements, opened, with_probe
from tests.helpers.stick import standing, stick_rig

EVIL = "a & <img src=x onerror=alert(1)>"


@pytest.fixture(scope="module")
def made() -> tuple[dict[str, Report], dict[str, Subject], Subject]:
    """Of one source, a result that stands, and one that sinks by 5 cm for a third of the time."""
    rig = stick_rig()
    still = standing(rig, 90)
    path = np.zeros((90, 3))
    path[30:60, 2] = -0.05
    source = Subject(still, rig)
    subjects = {"good": source, EVIL: Subject(replace(still, root_pos=still.root_pos + path), rig)}
    return {n: assess(s, source=source) for n, s in subjects.items()}, subjects, source


@pytest.fixture(scope="module")
def text(made: tuple[dict[str, Report], dict[str, Subject], Subject]) -> str:
    reports, subjects, source = made
    return compare_page(reports, subjects, ("the source", source), title=EVIL)


def test_the_table_has_the_reports_numbers(
    text: str, made: tuple[dict[str, Report], dict[str, Subject], Subject]
) -> None:
    table = re.search(r'<table id="measures">(.*?)</table>', text, re.S)
    assert table
    rows = re.findall(r"<tr><th scope=\"row\".*?</tr>", table[1], re.S)
    cells = {
        re.sub(r"<[^>]+>", "", unescape(row)).split()[0]: re.findall(r"<td([^>]*)>([^<]*)", row)
        for row in rows
    }
    good, bad = (f"{100 * report.implausible:.1f}" for report in made[0].values())
    assert [shown for _, shown in cells["implausible"]] == [good, bad]
    assert [kind for kind, _ in cells["implausible"]] == [' class="best"', ""]
    assert float(bad) >= 33.3
    assert {kind for kind, _ in cells["floating"]} == {""}  # alike: none is the best


def test_it_asks_for_nothing_and_names_are_text(text: str) -> None:
    assert not re.search(r"(src|href)\s*=\s*[\"']?(https?:)?//", text)
    assert not any("onerror" in attributes for _, attributes in Elements(text).tags)
    assert EVIL in "".join(Elements(text).texts)


def test_a_finding_goes_to_its_moment_in_the_replay(text: str, tmp_path: Path) -> None:
    script = """
      addEventListener("load", () => {
        const button = document.querySelector("button[data-time]");
        button.click();
        inside("tell()");
        document.body.dataset.result = JSON.stringify({
          time: Number(button.dataset.time), playing: inside("view.playing"),
          shown: Number.parseFloat(inside("el('time').textContent")),
          figures: inside("document.body.textContent.includes('good')"),
        });
      });"""
    seen = opened(with_probe(text, STILL_REPLAY + script), tmp_path)
    assert seen["time"] >= 0.5
    assert seen["shown"] == pytest.approx(seen["time"], abs=0.01)
    assert seen["figures"]
    assert not seen["playing"]
