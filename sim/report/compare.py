"""Several reports beside each other: of tools, settings, versions."""

from collections.abc import Mapping
from typing import NamedTuple

from sim.report.names import LABELS
from sim.report.palette import TERMINAL
from sim.report.result import Result
from sim.report.table import rows

_LABEL = 34  # the first column's width
_DIGITS = {"1e-4": 2, "% of height": 2}  # others are told with one


class Line(NamedTuple):
    """A measure of several reports: what each has of it, "-" where it has none, and which of these
    texts is the best, where they differ."""

    measure: str
    unit: str
    cells: tuple[str, ...]
    best: str | None


def lines(reports: Mapping[str, Result]) -> list[Line]:
    """A line for each measure that any of the reports has; less is better in all."""
    found = []
    for cells in zip(*(rows(report) for report in reports.values()), strict=True):
        known = [cell["value"] for cell in cells if cell["value"] is not None]
        if not known:
            continue
        unit = cells[0]["unit"]
        digits = _DIGITS.get(unit, 1)
        shown = tuple(
            "-" if (value := cell["value"]) is None else f"{value:.{digits}f}" for cell in cells
        )
        best = f"{min(known):.{digits}f}" if len({*shown} - {"-"}) > 1 else None
        found.append(Line(cells[0]["measure"], unit, shown, best))
    return found


def compare(reports: Mapping[str, Result], *, color: bool = False) -> str:
    """A table with a row for each measure and a column for each report; less is better in all.

    The least of each row is marked with a star, or coloured, where the reports differ.
    """
    width = max(9, *(len(name) + 2 for name in reports))
    text = ["".join([f"{'':<{_LABEL}}", *(f"{name:>{width}}" for name in reports)])]
    for line in lines(reports):
        label = f"{LABELS[line.measure]} [{line.unit}]"
        marked = [_cell(cell, cell == line.best, width, color) for cell in line.cells]
        text.append("".join([f"{label:<{_LABEL}}", *marked]))
    return "\n".join(line.rstrip() for line in text)


def _cell(text: str, best: bool, width: int, color: bool) -> str:
    if color:
        return f"\x1b[{TERMINAL['good']}m{text:>{width}}\x1b[0m" if best else f"{text:>{width}}"
    return f"{text + ('*' if best else ' '):>{width}}"
