"""Several reports of one source beside each other, as one self-contained web page: of tools,
settings, versions."""

from collections.abc import Mapping
from pathlib import Path

from markupsafe import Markup

from sim.report.annotate import annotate
from sim.report.compare import lines
from sim.report.explanations import MEANINGS
from sim.report.names import LABELS
from sim.report.page import figure_of, finding_line
from sim.report.palette import CORNER_COLORS, css, grade
from sim.report.result import Result
from sim.template import Template
from sim.trajectory import Subject
from sim.view.page import REPLAY, page
from spark.files import write_atomically

_PAGE = Template("sim.report", "compare.html", ("compare.js",), frames=(REPLAY,))
_LISTED = 12  # findings of each


def write_compare_page(
    reports: Mapping[str, Result],
    path: str | Path,
    subjects: Mapping[str, Subject],
    source: tuple[str, Subject] | None = None,
    *,
    title: str,
) -> None:
    """Write the page of reports that `assess` made of `subjects`, by the same names, and of their
    common `source`, which is named too."""
    text = compare_page(reports, subjects, source, title=title)
    write_atomically(Path(path), text.encode())


def compare_page(
    reports: Mapping[str, Result],
    subjects: Mapping[str, Subject],
    source: tuple[str, Subject] | None = None,
    *,
    title: str,
) -> str:
    """The page as text: a table, one replay of all side by side, and what to mend in each."""
    shown = [(name, subjects[name], report.clip) for name, report in reports.items()]
    theirs = next((r.source for r in reports.values() if r.source is not None), None)
    if source is not None and theirs is not None:
        shown.append((f"{source[0]} (source)", source[1], theirs))
    figures = [figure_of(subject, clip, name) for name, subject, clip in shown]
    found = [*(report.findings for report in reports.values()), ()]
    known = [
        annotate(clip, subject, findings)
        for (_, subject, clip), findings in zip(shown, found, strict=False)
    ]
    return _PAGE.render(
        title=title,
        palette=Markup(css()),
        key=CORNER_COLORS,
        tools=[
            {
                "name": name,
                "share": f"{100 * report.implausible:.1f} %",
                "grade": grade(100 * report.implausible),
                "findings": [finding_line(f, report.clip) for f in report.findings[:_LISTED]],
                "unlisted": max(len(report.findings) - _LISTED, 0),
            }
            for name, report in reports.items()
        ],
        source=None
        if source is None or theirs is None
        else {"name": source[0], "share": f"{100 * theirs.implausible_share:.1f} %"},
        lines=[
            {
                "label": LABELS[line.measure],
                "unit": line.unit,
                "meaning": MEANINGS.get(line.measure, ""),
                "cells": [{"text": cell, "best": cell == line.best} for cell in line.cells],
            }
            for line in lines(reports)
        ],
        replay=page(figures, title="", known=known),
        notes=_notes(reports),
    )


def _notes(reports: Mapping[str, Result]) -> list[str]:
    """Each note once, with the names of those that it is about, unless it is about all."""
    about: dict[str, list[str]] = {}
    for name, report in reports.items():
        for note in dict.fromkeys(report.notes):
            about.setdefault(note, []).append(name)
    return [
        note if len(names) == len(reports) else f"{', '.join(names)}: {note}"
        for note, names in about.items()
    ]
