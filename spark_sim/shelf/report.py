"""The report of a folder: one page for all of its motions, a page for each, and the tables."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, TypeAlias
from urllib.parse import quote

from markupsafe import Markup

from sim.report.names import FLAGS, LABELS, UNITS
from sim.report.palette import css, grade
from sim.template import Template
from spark.errors import DependencyError
from spark_sim.shelf.duplicates import Duplicates, merged, near_duplicates
from spark_sim.shelf.headline import MEASURES, key
from spark_sim.shelf.histogram import histogram
from spark_sim.shelf.items import Item
from spark_sim.shelf.measure import measure
from spark_sim.shelf.outputs import write_outputs
from spark_sim.shelf.processes import Died
from spark_sim.shelf.remembered import Measured
from spark_sim.shelf.tables import as_csv, as_json, as_parquet

Measurer: TypeAlias = Callable[
    [Callable[[Item], Measured], Sequence[Item]], Iterator[tuple[Item, Measured | Died]]
]
_PAGE = Template("spark_sim.shelf", "page.html", ("page.js",))
_SI = {"%": 100.0, "cm": 100.0}  # of a unit, in its SI unit


def outputs(page: Path) -> tuple[Path, Path, Path, Path]:
    """What is written beside the page: JSON, CSV, Parquet, and the folder of the clips' pages."""
    tables = (page.with_suffix(ending) for ending in (".json", ".csv", ".parquet"))
    return (*tables, page.with_name(f"{page.stem}_clips"))  # type: ignore[return-value]


def measure_all(
    found: Sequence[Item], page: Path, backend: Measurer
) -> Iterator[tuple[Item, Measured]]:
    """Each motion measured, and its own page written, in the order in which they are done."""
    *_, clips = outputs(page)
    for item, done in backend(partial(_below, clips), found):
        if isinstance(done, Died):
            done = Measured(item.name, {"file": item.name}, error=str(done))
        yield item, done


def write_folder_report(
    measured: Sequence[Measured], page: Path, title: str
) -> tuple[list[dict[str, Any]], Duplicates, tuple[str, ...]]:
    """Write the page and the tables, the worst motion first. Returns the rows, the
    near-duplicates, and notes on what could not be written."""
    good = sorted(
        (each for each in measured if each.error is None),
        key=lambda each: (-each.facts[key("implausible")], each.name),
    )
    failed = sorted((each for each in measured if each.error is not None), key=lambda e: e.name)
    # On several targets, a motion is the same on purpose.
    targets = sorted({each.target for each in good})
    found = merged(
        near_duplicates({e.name: e.fingerprint for e in good if e.target == target})
        for target in targets
    )
    twin = {name: group[0] for group in found.groups for name in group[1:]}
    whole = {part.name: part for part in found.parts}
    rows = [
        each.facts
        | {"duplicate_of": twin.get(each.name), "error": each.error}
        | {"part_of": whole[each.name].of if each.name in whole else None}
        for each in (*good, *failed)
    ]
    json_path, csv_path, parquet_path, clips = outputs(page)
    files = {json_path: as_json(rows, found), csv_path: as_csv(rows)}
    notes: tuple[str, ...] = ()
    try:
        files[parquet_path] = as_parquet(rows)
    except DependencyError as error:
        notes = (f"no {parquet_path.name}: {error}",)
    shown = [m for m in MEASURES if any(each.facts.get(key(m)) is not None for each in good)]
    text = _PAGE.render(
        title=title,
        palette=Markup(css()),
        about=_about(good, failed),
        tables=[path.name for path in files],
        measures=[
            {"name": m, "label": LABELS[m], "unit": UNITS[m], "flag": m in FLAGS} for m in shown
        ],
        histograms=[
            {
                "label": LABELS[m],
                "unit": UNITS[m],
                **histogram([v for each in good if (v := _value(each, m)) is not None]),
            }
            for m in shown
        ],
        clips=[
            {
                "name": each.name,
                "href": quote(f"{clips.name}/{each.name}.html", errors="surrogateescape"),
                "picture": Markup(each.picture),
                "duration": each.facts["duration_s"],
                "worst": each.facts["worst"],
                "duplicate_of": twin.get(each.name),
                "part": whole.get(each.name),
                "cells": [_cell(each, m) for m in shown],
            }
            for each in good
        ],
        failed=[{"name": each.name, "error": each.error} for each in failed],
        duplicates=found.groups,
        parts=found.parts,
    )
    write_outputs({**files, page: text.encode("utf-8", "replace")}, clips)
    return rows, found, notes


def _below(folder: Path, item: Item) -> Measured:
    return measure(item, folder / f"{item.name}.html")


def _about(good: Sequence[Measured], failed: Sequence[Measured]) -> str:
    minutes = sum(each.facts["duration_s"] for each in good) / 60
    words = f"{len(good)} motions, {minutes:.1f} minutes"
    if good:
        share = median(each.facts[key("implausible")] for each in good)
        words += f"; in the median {100 * share:.1f} % of the frames are implausible"
    return words + (f"; {len(failed)} could not be measured" if failed else "")


def _value(each: Measured, measure: str) -> float | None:
    """A measure in the unit that is shown."""
    value = each.facts.get(key(measure))
    return None if value is None else value * _SI.get(UNITS[measure], 1.0)


def _cell(each: Measured, measure: str) -> dict[str, Any]:
    value = _value(each, measure)
    if value is None:
        return {"text": "", "value": -1.0, "grade": ""}
    graded = grade(value) if measure in ("implausible", *FLAGS) else ""
    return {"text": f"{value:.1f}", "value": value, "grade": graded}
