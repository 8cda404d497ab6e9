"""What names can do to a page: nothing."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from sim.view.figure import Figure
from sim.view.page import REPLAY, page
from spark.errors import OutputError
from spark_sim import sample
from spark_sim.loading import load
from tests.helpers.browser import LONG, Elements, opened, watched

NOTHING: dict[str, Any] = {"speeds": (), "toggles": (), "controls": ()}
CHECKOUT = Path(__file__).parents[2]
HOSTILE = (
    "__DATA__<img src=x onerror=document.title=1337>",
    "</script><script>document.title=1337</script>",
    '</title></iframe>"><svg onload=document.title=1337>',
    "<!--<script>",
    "{{ 7 * 7 }}{% for a in b %}{#",
    "a' onmouseover=x \"&amp;&lt;\\u003c\\\u2028]]>",
)


@settings(deadline=None)
@given(st.text(st.characters(codec="utf-8", exclude_characters="\r\0")))
@example(HOSTILE[0])
@example(HOSTILE[1])
@example(HOSTILE[2])
@example(HOSTILE[3])
@example(HOSTILE[4])
@example(HOSTILE[5])
def test_a_name_is_text_and_nothing_else(name: str) -> None:
    """As title and in the data: the same elements as with any other name, and the name whole."""
    text = REPLAY.render(**NOTHING, title=name, data={"label": name})
    shown = Elements(text)
    assert shown.tags == Elements(REPLAY.render(**NOTHING, title="x", data={"label": "x"})).tags
    assert name in shown.texts or not name
    block = re.search(r'<script id="data" type="application/json">(.*?)</script>', text, re.S)
    assert block
    assert "<" not in block[1]
    assert json.loads(block[1]) == {"label": name}


def test_numbers_that_are_none_are_no_page() -> None:
    with pytest.raises(OutputError, match="a number that is none"):
        REPLAY.render(**NOTHING, title="x", data={"height": float("nan")})


def test_a_name_that_is_not_utf8() -> None:
    name = b"walk_\xff.bvh".decode("utf-8", "surrogateescape")
    assert "<title>walk_?.bvh</title>" in REPLAY.render(**NOTHING, title=name, data={"a": name})


TEMPLATES = sorted(
    path for package in ("sim", "spark_sim") for path in (CHECKOUT / package).rglob("*.html")
)


@pytest.mark.parametrize("path", TEMPLATES, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_templates_mark_nothing_as_safe(path: Path) -> None:
    template = path.read_text()
    assert "safe" not in template
    assert "autoescape" not in template


def test_the_policy_stops_what_would_slip_through(tmp_path: Path) -> None:
    """A page with hostile HTML in it all the same: the browser runs none of it."""
    walk = load(sample(tmp_path)[0])
    text = page([Figure(walk.subject, "x")], title="x")
    broken = text.replace("<canvas", "<img src=x onerror=document.title=1337>" + "<canvas", 1)
    broken = broken.replace("<canvas", "<script>document.title = 1337</script><canvas", 1)
    fine, result = (opened(watched(page), tmp_path, *LONG) for page in (text, broken))
    assert fine["seen"] == []
    assert {"script-src-elem", "script-src-attr", "img-src"} <= set(result["seen"])
    assert result["title"] == "x"
    ran = opened(re.sub('default-src[^"]*', "", watched(broken)), tmp_path, *LONG)
    assert ran["title"] == "1337", "without a policy it runs"


def test_each_page_has_one_main_part() -> None:
    """Readers of a page aloud go there first; its pictures have words, or none are read."""
    templates = [
        path.read_text()
        for package in ("sim", "spark_sim")
        for path in (CHECKOUT / package).rglob("*.html")
        if path.name not in ("base.html", "document.html")
    ]
    assert len(templates) > 4
    for text in templates:
        assert text.count("<main") == text.count("</main>") == 1
        for picture in re.findall(r"<(?:svg|iframe|canvas)[^>]*>", text):
            assert re.search(r'aria-label=|title=|aria-hidden="true"', picture), picture
