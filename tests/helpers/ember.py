"""Ember with other text in its file."""

import re
from collections.abc import Callable
from pathlib import Path

from robots.model.morphology import Morphology
from robots.model.understand import understand_robot
from robots.registry import find


def changed_ember(
    folder: Path, pattern: str, by: str | Callable[[re.Match[str]], str]
) -> Morphology:
    """As it is understood from a file in `folder`, where `by` stands for each match."""
    text, count = re.subn(pattern, by, Path(find("robot")).read_text(encoding="utf-8"))
    assert count
    (folder / "robot.xml").write_text(text, encoding="utf-8")
    return understand_robot(folder / "robot.xml")
