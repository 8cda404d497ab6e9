"""The page of a folder: histograms, targets, and a table that its script fills, so that a hundred
thousand motions are no burden on a browser."""

import math
from collections.abc import Sequence
from statistics import median
from typing import Any

from markupsafe import Markup

from sim.report.names import FLAGS, LABELS, UNITS
from sim.report.palette import GRADES, css
from sim.template import Template
from spark_sim.shelf.duplicates import Duplicates
from spark_sim.shelf.headline import MEASURES, key
from spark_sim.shelf.histogram import histogram
from spark_sim.shelf.remembered import Measured
from spark_sim.shelf.thumbnail import LAYOUT

_PAGE = Template("spark_sim.shelf", "page.html", ("page.js",))
_SI = {"%": 100.0, "cm": 100.0, "mm": 1000.0, "°": math.degrees(1)}  # of a unit, in its SI unit
_GRADED = ("implausible", *FLAGS)


def overview(
    title: str,
    good: Sequence[Measured],
    failed: Sequence[Measured],
    found: Duplicates,
    tables: Sequence[str],
    folder: str,
) -> str:
    """The page: `good` are the motions that were measured, whose own pages are in `folder`, and
    `tables` the names of the files that say the same."""
    shown = [m for m in MEASURES if any(each.facts.get(key(m)) is not None for each in good)]
    targets = sorted({each.target for each in good})
    return _PAGE.render(
        title=title,
        palette=Markup(css()),
        about=_about(good, failed),
        tables=tables,
        measures=[{"label": LABELS[m], "unit": UNITS[m]} for m in shown],
        histograms=[
            {"label": LABELS[m], "unit": UNITS[m], **histogram(_values(good, m))} for m in shown
        ],
        flags=[LABELS[m] for m in _GRADED],
        targets=[_target(name, [e for e in good if e.target == name]) for name in targets],
        failed=[f"{each.name}: {each.error}" for each in failed],
        duplicates=_sentences(found),
        data=_data(good, found, shown, targets, folder),
    )


def _data(
    good: Sequence[Measured],
    found: Duplicates,
    shown: Sequence[str],
    targets: Sequence[str],
    folder: str,
) -> dict[str, Any]:
    """What the page's script makes the table of: a list for each motion, in `page.js`'s order."""
    twin = {name: group[0] for group in found.groups for name in group[1:]}
    whole = {part.name: part.of for part in found.parts}
    place = {target: k for k, target in enumerate(targets)}
    bodies: dict[str, int] = {}
    clips = []
    for each in good:
        picture, facts = each.picture, each.facts
        body = bodies.setdefault(str(picture["bones"]), len(bodies))
        values = [_value(each, m) for m in shown]
        clips.append(
            [
                *(each.name, place[each.target], round(facts["duration_s"], 3), facts["worst"]),
                *(twin.get(each.name), whole.get(each.name)),
                [body, picture["points"], picture["worst"]],
                *(None if value is None else float(f"{value:.4g}") for value in values),
            ]
        )
    drawn = {str(each.picture["bones"]): each.picture["bones"] for each in good}
    return {
        "clips": clips,
        "folder": folder,
        "layout": LAYOUT,
        "bones": [drawn[body] for body in bodies],
        "measures": [{"graded": m in _GRADED} for m in shown],
        "grades": GRADES,
    }


def _target(name: str, motions: Sequence[Measured]) -> dict[str, Any]:
    values = [_values(motions, m) for m in _GRADED]
    return {
        "name": name or "not of a batch",
        "count": len(motions),
        "medians": [median(each) if each else None for each in values],
    }


def _sentences(found: Duplicates) -> list[str]:
    return [", ".join(group) for group in found.groups] + [
        f"{part.name} is a part of {part.of}, from {part.start:.1f} s on" for part in found.parts
    ]


def _about(good: Sequence[Measured], failed: Sequence[Measured]) -> str:
    minutes = sum(each.facts["duration_s"] for each in good) / 60
    words = f"{len(good)} motions, {minutes:.1f} minutes"
    if good:
        share = median(each.facts[key("implausible")] for each in good)
        words += f"; in the median {100 * share:.1f} % of the frames are implausible"
    return words + (f"; {len(failed)} could not be measured" if failed else "")


def _values(motions: Sequence[Measured], measure: str) -> list[float]:
    return [v for each in motions if (v := _value(each, measure)) is not None]


def _value(each: Measured, measure: str) -> float | None:
    """A measure in the unit that is shown."""
    value = each.facts.get(key(measure))
    return None if value is None else value * _SI.get(UNITS[measure], 1.0)
