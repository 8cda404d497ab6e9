"""Names of every source, by somebody who means harm, in the pages as a browser opens them."""

import re
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import pytest

import spark_sim
from robots import registry
from tests.helpers.browser import LONG, Elements, opened, watched

# What works in an element, in a script, in an attribute, and in a chain of replacements. No `/`
# where it names a file.
FILE = """__DATA__<!--<script>"'><img src=x onerror=document.title=1337>"""
HOSTILE = FILE + "</script></title></iframe><svg onload=document.title=1337>"


def character(folder: Path, name: str, suffix: str) -> Path:
    """A walk of two seconds in a file of that name; all joints' names end in `suffix`."""
    (walk, *_) = spark_sim.sample(folder / "made", force=True)
    text = re.sub(r"(ROOT|JOINT) (\S+)", lambda m: f"{m[0]}{suffix}", walk.read_text())
    path = folder / f"{name}.bvh"
    path.write_text(text)
    return path


def robot(folder: Path, name: str, suffix: str) -> Path:
    """Our robot in a file of that name, its model and all that moves called something else."""
    model = registry.find("robot").read_text()
    path = folder / f"{name}.xml"
    names = r'\b(model|name|joint|body[12]?|site|material)="([^"]*)"'
    path.write_text(re.sub(names, lambda m: f"{m[1]}={quoteattr(m[2] + suffix)}", model))
    return path


@pytest.mark.parametrize("kind", [character, robot])
def test_names_are_shown_and_do_nothing(kind: Any, tmp_path: Path) -> None:
    """The replay and the report have the elements that they have with plain names; their scripts
    run, the policy has nothing to stop, and the title is the file's name."""
    elements: dict[str, Any] = {}
    for name, suffix in (("plain", ""), (FILE, HOSTILE)):
        folder = tmp_path / str(len(elements))
        folder.mkdir()
        clip = spark_sim.load(kind(folder, name, suffix))
        if kind is robot:
            clip = spark_sim.retarget(character(folder, name, suffix), clip)
        spark_sim.play(clip, html=folder / "replay.html")
        spark_sim.report(clip, html=folder / "report.html")
        elements[name] = [Elements(page.read_text()).tags for page in sorted(folder.glob("*.html"))]
    plain, hostile = elements.values()
    assert hostile == plain
    for page in sorted(folder.glob("*.html")):
        text = page.read_text()
        came_to = opened(watched(text), tmp_path, *LONG)
        assert came_to["seen"] == []
        assert name in came_to["title"]
        assert "frame" in came_to["time"]
