"""A hook of mkdocs: the files at the top of the checkout become pages of the site.

README.md is its first page. Links in these files are relative to the checkout, those of the site to
docs/, so they are rewritten, and a link to a file that is no page fails the build.
"""

import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File

CHECKOUT = Path(__file__).parents[1]
PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
}
_LINK = re.compile(r"(?<=\]\()([^)#\s]+)")


def page(text: str) -> str:
    """A file's text as a page of the site."""

    def moved(link: re.Match[str]) -> str:
        place = link[1]
        return PAGES.get(place, place.removeprefix("docs/"))

    return _LINK.sub(moved, text)


def on_files(files: Any, config: Any) -> Any:
    """Add the pages, and the licence that they link to."""
    for name, place in PAGES.items():
        files.append(File.generated(config, place, content=page((CHECKOUT / name).read_text())))
    files.append(File.generated(config, "LICENSE", content=(CHECKOUT / "LICENSE").read_text()))
    return files
