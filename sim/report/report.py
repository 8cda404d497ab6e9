"""The report: a result, and how it is read by a person, a program, a table or a notebook."""

from dataclasses import dataclass
from typing import Any

from sim.report.record import record
from sim.report.result import Result
from sim.report.table import Row, rows, to_html
from sim.report.text import render


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
        parts = ", ".join(f"{name} {share:.1%}" for name, share in self.clip.shares.items())
        return f"<Report: {self.implausible:.1%} of {len(self.clip)} frames implausible; {parts}>"

    def _repr_html_(self) -> str:
        return to_html(self.rows())
