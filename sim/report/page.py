"""The report as one self-contained web page: headline, replay, worst moments, plots."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from sim.report.annotate import annotate
from sim.report.clip_metrics import ClipMetrics
from sim.report.explanations import MEANINGS
from sim.report.joints import joint_rows
from sim.report.moments import worst_moments
from sim.report.names import LABELS
from sim.report.palette import CORNER_COLORS, css, grade
from sim.report.plots import flag_strips, plots, svg
from sim.report.record import record
from sim.report.result import Finding, Result
from sim.report.table import shares
from sim.report.text import details, share_base
from sim.template import Template
from sim.trajectory import Subject
from sim.view.figure import Figure
from sim.view.page import REPLAY, page
from spark.files import write_atomically
from spark.summary import counted

_PAGE = Template("sim.report", "page.html", ("page.js",), frames=(REPLAY,))
_LISTED = 200  # findings


def write_report_page(
    result: Result,
    path: str | Path,
    subject: Subject,
    source: Subject | None = None,
    *,
    title: str,
    names: tuple[str, str] = ("motion", "source"),
) -> None:
    """Write the page of `result`, which `assess` made of `subject` and `source`, to `path`."""
    text = report_page(result, subject, source, title=title, names=names)
    write_atomically(Path(path), text.encode())


def report_page(
    result: Result,
    subject: Subject,
    source: Subject | None = None,
    *,
    title: str,
    names: tuple[str, str] = ("motion", "source"),
) -> str:
    """The page as text; it opens offline. Where nothing can be drawn off screen its pictures are
    left out, and it says so."""
    shown = [(subject, result.clip, names[0])]
    if source is not None and result.source is not None:
        shown.append((source, result.source, names[1]))
    figures = [figure_of(each, metrics, name) for each, metrics, name in shown]
    clip, frame_time = result.clip, result.clip.frame_time
    duration = (len(clip) - 1) * frame_time
    source_duration = (subject if source is None else source).motion.duration
    moments, note = worst_moments(result, figures)
    found = [result.findings, ()]
    known = [
        annotate(metrics, each, findings)
        for (each, metrics, _), findings in zip(shown, found, strict=False)
    ]
    columns, joints = _joints(clip)
    beside = ""
    if result.source is not None:
        beside = f"; of the source's {100 * result.source.implausible_share:.1f} %"
    return _PAGE.render(
        title=title,
        palette=Markup(css()),
        grade=grade(100 * result.implausible),
        headline=f"{100 * result.implausible:.1f} % of the frames are implausible",
        about=f"{counted(len(clip), 'frame')}, {duration:.1f} s{beside}",
        cards=_cards(result),
        key=CORNER_COLORS,
        replay=page(figures, title="", known=known),
        findings=[finding_line(f, clip) for f in result.findings[:_LISTED]],
        unlisted=max(len(result.findings) - _LISTED, 0),
        moments=[
            {
                "time": f"{moment.frame * frame_time:.3f}",
                "picture": moment.picture,
                "findings": [finding_line(f, clip) for f in moment.findings],
            }
            for moment in moments
        ],
        shown=" and ".join(name for _, _, name in shown),
        columns=columns,
        joints=joints,
        strips=flag_strips(clip),
        plots=Markup().join(svg(plot, duration, source_duration) for plot in plots(result)),
        notes=(*result.notes, *([note] if note else []), clip.thresholds.version),
        duration=duration,
        record=record(result),
    )


def figure_of(subject: Subject, clip: ClipMetrics, name: str) -> Figure:
    """What is shown of a subject: the ground that it was judged on, too."""
    on_it = replace(subject, terrain=clip.ground.terrain)
    return Figure(on_it, name, clip.floor_z, tops=clip.ground.tops)


def _cards(result: Result) -> list[dict[str, Any]]:
    """A card for each measure, with what it means."""
    theirs = {} if result.source is None else shares(result.source)
    cards: list[dict[str, Any]] = []

    def add(measure: str, label: str, value: str, lines: list[str], grade: str = "") -> None:
        card = {"label": label, "value": value, "lines": lines, "grade": grade}
        cards.append({**card, "meaning": MEANINGS[measure]})

    for measure, percent in shares(result.clip).items():
        if percent is None:
            continue
        small = [] if (their := theirs.get(measure)) is None else [f"source {their:.1f} %"]
        if base := share_base(result.clip, measure):
            small.append(base)
        add(measure, LABELS[measure], f"{percent:.1f} %", small, grade(percent))
    for detail in details(result):
        value, _, rest = detail.words.strip().partition("  ")
        add(detail.measure, detail.label, value, [rest.strip()])
    return cards


_COLUMNS = ("room to its limit", "at a limit", "fastest", "jerk RMS")
_TORQUES = ("highest torque", "RMS torque", "of its motor's")


def _joints(clip: ClipMetrics) -> tuple[tuple[str, ...], list[dict[str, Any]]]:
    """The columns and rows of the joints' table."""
    rows = []
    for row in joint_rows(clip):
        beyond = row.room is not None and row.room < 0
        over = row.load is not None and row.load > clip.thresholds.torque
        cells = [
            _cell(row.room, float(np.degrees(1.0)), "°", "bad" if beyond else ""),
            _cell(row.at_limit, 100.0, " %", "fair" if row.at_limit else ""),
            _cell(row.speed, 1.0, " rad/s"),
            _cell(row.jerk, 1.0, " rad/s³"),
        ]
        if clip.torques:
            cells += [
                _cell(row.torque, 1.0, " N m"),
                _cell(row.rms, 1.0, " N m"),
                _cell(row.load, 100.0, " %", "bad" if over else ""),
            ]
        rows.append({"name": row.name, "cells": cells})
    return (*_COLUMNS, *(_TORQUES if clip.torques else ())), rows


def _cell(value: float | None, factor: float, unit: str, grade: str = "") -> dict[str, str]:
    if value is None:
        return {"text": "\u2013", "grade": ""}
    shown = factor * value
    return {"text": f"{shown:.{0 if abs(shown) >= 100 else 1}f}{unit}", "grade": grade}


def finding_line(finding: Finding, clip: ClipMetrics) -> dict[str, Any]:
    """A finding in words, and the time [s] that a click on it goes to."""
    return {
        "time": f"{finding.start * clip.frame_time:.3f}",
        "sentence": finding.sentence,
        "place": finding.place(clip.frame_time),
    }
