"""Rows of an evaluation as Markdown, JSON and CSV."""

import csv
import io
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict, fields
from typing import Any

from spark.evaluation.cases import STRUCTURES, Structure
from spark.evaluation.evaluate import MethodScores
from spark.evaluation.metrics import Score

FORMAT, VERSION = "spark-sim evaluation", 1

_TITLES = {
    "intra": "intra-structural",
    "cross": "cross-structural",
    "missing": "joints that the source lacks",
}
# The order of the paper's table 2, by the switch that a training threw.
_ABLATIONS = {"share": "w/o share", "mask": "w/o mask", "pos": "w/ pos", "fk": "w/o FK", "": "full"}


def markdown(rows: Sequence[MethodScores]) -> str:
    """Table 1 (MSE by cells), table 2 (ablations, where there are any), and all metrics."""
    parts = [_cells_table(rows), _ablations_table(rows), _metrics_table(rows)]
    return "\n".join(part for part in parts if part)


def as_json(rows: Sequence[MethodScores], about: dict[str, Any]) -> str:
    """Everything there is, NaN as null; `about` says what was evaluated."""
    records = [
        {
            "name": row.name,
            "training": dict(row.settings) or None,
            "sensitivity": {kind: _number(row.sensitivity[kind]) for kind in STRUCTURES},
            "cells": [
                {"structure": kind, "cell": cell, "cases": of_one.cases, **_numbers(of_one.score)}
                for (kind, cell), of_one in row.cells.items()
            ],
        }
        for row in rows
    ]
    return (
        json.dumps({"format": FORMAT, "version": VERSION, **about, "rows": records}, indent=1)
        + "\n"
    )


def as_csv(rows: Sequence[MethodScores]) -> str:
    """One line for each method, structure and cell."""
    out = io.StringIO()
    names = [f.name for f in fields(Score)]
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(["method", "structure", "cell", "cases", *names])
    for row in rows:
        for (kind, cell), of_one in row.cells.items():
            writer.writerow([row.name, kind, cell, of_one.cases, *_numbers(of_one.score).values()])
    return out.getvalue()


def _cells_table(rows: Sequence[MethodScores]) -> str:
    titles: list[str] = []
    lines = [[row.name] for row in rows]
    for kind in _kinds(rows):
        cells = [cell for structure, cell in rows[0].cells if structure == kind]
        titles += [f"{kind} {cell}".rstrip() for cell in cells]
        titles += [f"{kind} mean"] if len(cells) > 1 else []
        for row, line in zip(rows, lines, strict=True):
            found = [row.cells.get((kind, cell)) for cell in cells]
            line += ["-" if cell is None else _shown(cell.score.mse) for cell in found]
            line += [_shown(row.mean(kind).mse)] if len(cells) > 1 else []
    counts = [
        f"{f'{kind} {cell}'.rstrip()} {of_one.cases}"
        for (kind, cell), of_one in rows[0].cells.items()
    ]
    return _table(["MSE", *titles], lines) + f"\nCases: {', '.join(counts)}.\n"


def _ablations_table(rows: Sequence[MethodScores]) -> str:
    """The paper's table 2: (a) all characters have motions of their own, (b) they share them."""
    found: dict[tuple[str, bool], MethodScores] = {}
    for row in rows:
        thrown = [str(switch) for switch in _listed(row.settings.get("ablate"))]
        others = [switch for switch in thrown if switch != "mix"]
        if row.settings.get("preset") == "paper" and len(others) <= 1:
            found["".join(others), "mix" in thrown] = row
    kinds = _kinds(rows)
    lines = [
        [
            title,
            *(
                _shown(found[switch, mixed].mean(kind).mse) if (switch, mixed) in found else ""
                for mixed in (False, True)
                for kind in kinds
            ),
        ]
        for switch, title in _ABLATIONS.items()
        if (switch, False) in found or (switch, True) in found
    ]
    titles = [f"{kind}, {data}" for data in ("distinct", "mixed") for kind in kinds]
    return _table(["MSE of the paper's preset", *titles], lines) if len(found) > 1 else ""


def _metrics_table(rows: Sequence[MethodScores]) -> str:
    titles = (
        "root-relative MSE",
        "MPJPE, % of height",
        "standing feet, heights/s",
        "jerk, heights/s³",
        "source sensitivity",
    )
    parts = []
    for kind in _kinds(rows):
        lines = []
        for row in rows:
            mean = row.mean(kind)
            lines.append(
                [
                    row.name,
                    _shown(mean.relative_mse),
                    _shown(mean.mpjpe),
                    f"{_shown(mean.foot_speed)} ({_shown(mean.truth_foot_speed)})",
                    f"{_shown(mean.jerk)} ({_shown(mean.truth_jerk)})",
                    _shown(row.sensitivity[kind]),
                ]
            )
        parts.append(_table([_TITLES[kind], *titles], lines))
    return "\n".join(parts) + "\nIn brackets what the ground truth itself does.\n"


def _kinds(rows: Sequence[MethodScores]) -> list[Structure]:
    return [kind for kind in STRUCTURES if any(kind == own for own, _ in rows[0].cells)]


def _table(titles: Sequence[str], lines: Iterable[Sequence[str]]) -> str:
    head = f"| {' | '.join(titles)} |\n|---|{'---|' * (len(titles) - 1)}\n"
    return head + "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _shown(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.3g}"


def _numbers(score: Score) -> dict[str, float | None]:
    return {name: _number(value) for name, value in asdict(score).items()}


def _number(value: float) -> float | None:
    return None if math.isnan(value) else value


def _listed(value: object) -> list[object]:
    return list(value) if isinstance(value, list | tuple) else []
