"""The report as rows of a table: one number a measure, less is better in all."""

from collections.abc import Callable
from typing import TypedDict

import numpy as np

from sim.report.clip_metrics import ClipMetrics
from sim.report.names import FLAGS, UNITS
from sim.report.result import Result


class Row(TypedDict):
    """One measure of a motion and the same of its source, in `unit`; None where it has none."""

    measure: str
    value: float | None
    unit: str
    source: float | None


def shares(clip: ClipMetrics) -> dict[str, float | None]:
    """The measures that are shares of frames [%], by name; None of a clip that never rests,
    and of a body that tells no limits of its torque."""
    balance, torque = clip.unbalanced_share, clip.overload_share
    return {
        **{name: 100 * clip.shares[name] for name in FLAGS},
        "joint_limit": 100 * clip.limit_share,
        "at_limit": 100 * clip.at_limit_share,
        "self_penetration": 100 * float(clip.self_penetration.mean()),
        "balance": None if balance is None else 100 * balance,
        "torque": None if torque is None else 100 * torque,
    }


RATES: dict[str, Callable[[ClipMetrics], float]] = {
    "base_acceleration": lambda clip: clip.base_acceleration_p99,
    "joint_speed": lambda clip: float(clip.joint_pace.max(initial=0.0)),
    "joint_jerk": lambda clip: clip.jerk_rms,
}
"""The measures of how fast the base and the joints move."""


def source_rate(result: Result, measure: str) -> float | None:
    """The source's value of one of `RATES`; of the base scaled by the hip heights' ratio."""
    if result.source is None:
        return None
    value = RATES[measure](result.source)
    return value * result.scale if measure == "base_acceleration" else value


def rows(result: Result) -> list[Row]:
    """A row for each measure; those against a source or a ground truth have no source's value."""
    clip, source = result.clip, result.source
    contacts, drift, truth = result.contacts, result.drift, result.truth
    swing = result.swing
    trembles = (result.tremble.largest, result.tremble.source_largest)
    theirs = {} if source is None else shares(source)
    rates = [_row(name, value(clip), source_rate(result, name)) for name, value in RATES.items()]
    recall, precision = (None, None) if contacts is None else (contacts.recall, contacts.precision)
    return [
        _row(
            "implausible",
            100 * result.implausible,
            None if source is None else 100 * source.implausible_share,
        ),
        *(_row(name, value, theirs.get(name)) for name, value in shares(clip).items()),
        _row("missed_contact", None if recall is None else 100 * (1 - recall)),
        _row("invented_contact", None if precision is None else 100 * (1 - precision)),
        _row("swing_clearance", None if swing is None else 100 * abs(1 - swing.clearance)),
        _row("pose", None if result.pose is None else float(np.degrees(result.pose.mean))),
        _row("tremble", *(None if value is None else 1000 * value for value in trembles)),
        _row("root_drift", None if drift is None else 100 * float(drift.distance.max())),
        *rates[:1],
        _row("limb_acceleration", None if result.limbs is None else result.limbs.ratio),
        *rates[1:],
        _row("ground_truth_mse", None if truth is None else 1e4 * truth.mse),
        _row("ground_truth_mpjpe", None if truth is None else truth.mpjpe),
    ]


def _row(measure: str, value: float | None, source: float | None = None) -> Row:
    return {"measure": measure, "value": value, "unit": UNITS[measure], "source": source}
