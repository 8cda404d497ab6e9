"""A report in few numbers: what the manifest, tables and `--keep` have of each motion."""

import math
from typing import TYPE_CHECKING, Final

from sim.report.names import UNITS

if TYPE_CHECKING:
    from sim.report import Report

MEASURES: Final = tuple(name for name in UNITS if not name.startswith("ground_truth"))
"""The measures of a motion and its source, in the report's order; less is better in all."""

_SI: Final = {
    "%": ("share", 0.01),
    "cm": ("m", 0.01),
    "mm": ("m", 0.001),
    "°": ("rad", math.radians(1)),
    "m/s²": ("m_s2", 1.0),
    "x": ("of_source", 1.0),
    "rad/s": ("rad_s", 1.0),
    "rad/s³": ("rad_s3", 1.0),
}
"""What a measure of a unit is called in SI, and how many of that it is."""


def key(measure: str) -> str:
    """The name of a measure in JSON and tables, with its unit: `implausible_share`."""
    return f"{measure}_{_SI[UNITS[measure]][0]}"


def headline(report: "Report") -> dict[str, float | None]:
    """Each measure by its key, in SI units; None where the motion has none."""
    values = {row["measure"]: row["value"] for row in report.rows()}
    return {
        key(measure): None
        if (value := values[measure]) is None or not math.isfinite(value)
        else value * _SI[UNITS[measure]][1]
        for measure in MEASURES
    }
