"""A report in few numbers: what the manifest, tables and `--keep` have of each motion."""

import math
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from sim.report import Report

SCALES: Final = {"%": 0.01, "cm": 0.01, "rad/s": 1.0, "rad/s³": 1.0}
SUFFIXES: Final = {"%": "share", "cm": "m", "rad/s": "rad_s", "rad/s³": "rad_s3"}

UNITS: Final = {
    "implausible": "%",
    "penetration": "%",
    "floating": "%",
    "skating": "%",
    "root_wrench": "%",
    "joint_limit": "%",
    "at_limit": "%",
    "self_penetration": "%",
    "balance": "%",
    "missed_contact": "%",
    "invented_contact": "%",
    "root_drift": "cm",
    "joint_speed": "rad/s",
    "joint_jerk": "rad/s³",
}
"""The measures of a motion and its source, in the report's order and units; less is better."""


def key(measure: str) -> str:
    """The name of a measure in JSON and tables, with its unit: `implausible_share`."""
    return f"{measure}_{SUFFIXES[UNITS[measure]]}"


def headline(report: "Report") -> dict[str, float | None]:
    """Each measure by its key, in SI units; None where the motion has none."""
    values = {row["measure"]: row["value"] for row in report.rows()}
    return {
        key(measure): None
        if (value := values[measure]) is None or not math.isfinite(value)
        else value * SCALES[unit]
        for measure, unit in UNITS.items()
    }
