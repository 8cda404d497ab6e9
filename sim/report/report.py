"""The report: a result, and how it is read by a person, a program, a table or a notebook."""

from dataclasses import dataclass
from html import escape
from typing import Any

from sim.report.names import LABELS
from sim.report.palette import TILE_COLORS, grade
from sim.report.record import record
from sim.report.result import Result
from sim.report.table import Row, rows, shares
from sim.report.text import render
from spark.summary import html_table, time_span


@dataclass(frozen=True, eq=False, repr=False)
class Report(Result):
    """What `assess` yields."""

    def text(self, *, color: bool = False) -> str:
        """What a person reads: headline, parts, and what to mend; with ANSI colours on request."""
        return render(self, color=color)

    def json(self) -> dict[str, Any]:
        """The report for a program, as plain dicts, lists and numbers; SI, units in the keys."""
        return record(self)

    def rows(self) -> list[Row]:
        """A row for each measure, with its value, unit and the source's value: for
        `pandas.DataFrame`, or a table of one's own."""
        return rows(self)

    def __repr__(self) -> str:
        span = time_span(len(self.clip), self.clip.frame_time)
        parts = ", ".join(f"{name} {100 * share:.1f}" for name, share in self.clip.shares.items())
        return f"Report({span}, {100 * self.implausible:.1f} % implausible: {parts})"

    def _repr_html_(self) -> str:
        cells = [
            (f"{LABELS[r['measure']]} [{r['unit']}]", _number(r["value"]), _number(r["source"]))
            for r in self.rows()
            if r["value"] is not None
        ]
        return self._tiles() + html_table("report", [("", "motion", "source"), *cells], self.notes)

    def _tiles(self) -> str:
        """The headline and the measures' shares of the frames, as coloured tiles."""
        shown = {"implausible": 100 * self.implausible, **shares(self.clip)}
        theirs = {} if self.source is None else shares(self.source)
        tiles = "".join(
            '<div style="border:1px solid #8886;border-radius:8px;padding:6px 12px">'
            f"<div>{escape(LABELS[name])}</div>"
            f'<b style="font-size:1.5em;color:{TILE_COLORS[grade(percent)]}">{percent:.1f} %</b>'
            f"<div><small>{_beside(theirs.get(name))}</small></div></div>"
            for name, percent in shown.items()
            if percent is not None
        )
        return f'<div style="display:flex;flex-wrap:wrap;gap:8px;margin-bottom:8px">{tiles}</div>'


def _beside(percent: float | None) -> str:
    return "&nbsp;" if percent is None else f"source {percent:.1f} %"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.2f}"
