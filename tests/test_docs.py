"""What the pages of the documentation point at exists: links, anchors, files, names, pictures."""

import importlib
import re
from pathlib import Path

import pytest

import spark_sim

CHECKOUT = Path(__file__).parents[1]
DOCS = CHECKOUT / "docs"
PAGES = [*sorted(CHECKOUT.glob("*.md")), *sorted(DOCS.glob("*.md"))]
LARGEST_PICTURE = 200_000  # bytes


def prose(text: str) -> str:
    """A page without its blocks of code."""
    return re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)


def anchors(text: str) -> set[str]:
    """What links can point at in a page: its headings, as GitHub and mkdocs write them."""
    headings = re.findall(r"^#+ (.+)$", prose(text), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def broken_links(page: Path, text: str) -> list[str]:
    broken = []
    for link in re.findall(r"\]\(([^)]+)\)", prose(text)):
        if re.match(r"https?://", link):
            continue
        place, _, anchor = link.partition("#")
        target = (page.parent / place) if place else page
        if not target.exists() or (
            anchor and anchor not in anchors(text if target == page else target.read_text())
        ):
            broken.append(link)
    return broken


def broken_names(text: str) -> list[str]:
    """What a page has in backticks, looks like a file or a dotted name of ours, and is none."""
    broken = []
    for name in re.findall(r"`([^`\s]+)`", prose(text)):
        if re.fullmatch(r"(spark|sim|robots|spark_sim|scripts|tests|docs)/[\w./]+", name):
            if not (CHECKOUT / name).exists():
                broken.append(name)
        elif re.fullmatch(r"(spark|sim|robots|spark_sim)(\.\w+)+", name) and not resolves(name):
            broken.append(name)
    return broken


def resolves(name: str) -> bool:
    """Whether a dotted name is a module, or something in one."""
    path = CHECKOUT.joinpath(*name.split("."))
    if path.is_dir() or path.with_suffix(".py").exists():
        return True
    module, _, attribute = name.rpartition(".")
    path = path.parent
    return (path.is_dir() or path.with_suffix(".py").exists()) and hasattr(
        importlib.import_module(module), attribute
    )


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_what_a_page_points_at_exists(page: Path) -> None:
    text = page.read_text()
    assert broken_links(page, text) == []
    if page.name != "CHANGELOG.md":  # that tells of what is gone, too
        assert broken_names(text) == []


def test_the_checks_can_fail() -> None:
    page = DOCS / "report.md"
    text = "# Here\n[a](robots.md#here) [b](#here) [c](gone.md) [d](robots.md#which-robots)"
    assert broken_links(page, text) == ["robots.md#here", "gone.md"]
    names = "`spark/rig/gone.py` `spark.rig.roles.Role` `spark.rig.roles.Roll` `spark_sim.load`"
    assert broken_names(names) == ["spark/rig/gone.py", "spark.rig.roles.Roll"]


def test_every_page_is_on_the_site() -> None:
    nav = (CHECKOUT / "mkdocs.yml").read_text()
    assert {page.name for page in DOCS.glob("*.md")} <= set(re.findall(r"[\w-]+\.md", nav))


def test_the_api_page_has_every_public_name() -> None:
    listed = re.findall(r"^::: spark_sim\.(\w+)$", (DOCS / "api.md").read_text(), re.MULTILINE)
    assert sorted(listed) == sorted(spark_sim.__all__)


def test_pictures_are_small() -> None:
    for picture in (DOCS / "images").iterdir():
        assert picture.stat().st_size < LARGEST_PICTURE, picture.name


def test_the_table_of_changes_names_what_is_there() -> None:
    """In a row "I want to change ... -> open ...", the names stand in the file."""
    text = (DOCS / "architecture.md").read_text()
    rows = re.findall(r"^\| [^|]+ \| (`[\w/]+\.py`[^|]*) \| (.+) \|$", text, re.MULTILINE)
    assert len(rows) >= 50
    for files, where in rows:
        named = re.findall(r"`([\w/]+\.py)`", f"{files} {where}")
        text = "".join((CHECKOUT / file).read_text() for file in named)
        for name in re.findall(r"`(\w+)`", where):
            assert re.search(rf"\b{name}\b", text), f"{name} in {files}"
