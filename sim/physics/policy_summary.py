"""What a policy made of a motion, over seeds, as plain data for JSON and as text."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from sim.physics.policy_tracking import PolicyRun, PolicyTracker
from spark.summary import counted

SCHEMA = "spark-sim policy 1"
_LISTED = 8  # joints in the text: the most loaded ones


def summarize(tracker: PolicyTracker, runs: Sequence[PolicyRun]) -> dict[str, Any]:
    """The measures as JSON: lengths in cm, angles in degrees, speeds in m/s, torques in N m and as
    shares of the joints' limits. Errors are over all steps, those after a fall included: the robot
    is put back and goes on."""
    dt = tracker.frame_time
    limits = np.where(np.isfinite(tracker.limits), tracker.limits, np.nan)
    seeds = [
        {
            "seed": run.seed,
            "falls": len(run.falls),
            "fell_at_s": [round(step * dt, 3) for step in run.falls],
            "body_error_cm": round(100 * float(run.apart[1:].mean()), 3),
            "joint_error_deg": round(float(np.degrees(run.angles[1:].mean())), 3),
            "root_speed_error_m_s": round(float(run.speed[1:].mean()), 4),
            "torque_rms_share": _share(np.sqrt((run.square[1:] / limits**2).mean(axis=0))),
        }
        for run in runs
    ]
    square = np.mean([run.square[1:].mean(axis=0) for run in runs], axis=0)
    peak = np.max([run.peak.max(axis=0) for run in runs], axis=0)
    saturated = np.mean([run.saturated[1:].mean(axis=0) for run in runs], axis=0)
    order = np.argsort(-np.nan_to_num(np.sqrt(square) / limits), kind="stable")
    return {
        "schema": SCHEMA,
        "steps": len(tracker.qpos),
        "rate_hz": tracker.spec.rate,
        "duration_s": round((len(tracker.qpos) - 1) * dt, 4),
        "seeds": seeds,
        "falls": sum(each["falls"] for each in seeds),
        "runs_without_fall": sum(not each["falls"] for each in seeds),
        "body_error_cm": _mean(seeds, "body_error_cm"),
        "joint_error_deg": _mean(seeds, "joint_error_deg"),
        "root_speed_error_m_s": _mean(seeds, "root_speed_error_m_s"),
        "torque_rms_share": _mean(seeds, "torque_rms_share"),
        "joints": [
            {
                "name": tracker.spec.joints[k],
                "limit_nm": None if np.isnan(limits[k]) else round(float(limits[k]), 3),
                "peak_nm": round(float(peak[k]), 3),
                "rms_nm": round(float(np.sqrt(square[k])), 3),
                "saturated": round(float(saturated[k]), 5),
            }
            for k in order.tolist()
        ],
        "notes": list(tracker.notes),
    }


def render(metrics: dict[str, Any], name: str, policy: str) -> str:
    """The text of the `metrics` that `summarize` yields, of the motion `name`."""
    seeds, duration = metrics["seeds"], metrics["duration_s"]
    falls = [each["falls"] for each in seeds]
    if not any(falls):
        verdict = f"stays up for all {duration:.2f} s in {counted(len(seeds), 'run')}"
    else:
        first = min(t for each in seeds for t in each["fell_at_s"])
        verdict = (
            f"falls {counted(sum(falls), 'time')} in {counted(len(seeds), 'run')} of "
            f"{duration:.2f} s (by seed: "
            f"{', '.join(map(str, falls))}); first after {first:.2f} s"
        )
    lines = [
        f"{name}: followed by {policy} in simulation, {metrics['rate_hz']:g} Hz",
        f"  {verdict}",
        f"  error     bodies {_spread(seeds, 'body_error_cm', '.2f')} cm away, seen from the root; "
        f"joints {_spread(seeds, 'joint_error_deg', '.2f')} deg; root's speed "
        f"{_spread(seeds, 'root_speed_error_m_s', '.3f')} m/s off",
    ]
    if metrics["torque_rms_share"] is not None:
        share = 100 * metrics["torque_rms_share"]
        lines.append(f"  effort    torques are {share:.1f} % of their limits (RMS, all joints)")
    lines.append(f"  torque    {'joint':<28} {'limit':>7} {'peak N m':>9} {'RMS N m':>9} at limit")
    for row in metrics["joints"][:_LISTED]:
        limit = "-" if row["limit_nm"] is None else f"{row['limit_nm']:.0f}"
        lines.append(
            f"            {row['name']:<28} {limit:>7} {row['peak_nm']:>9.1f} "
            f"{row['rms_nm']:>9.1f} {100 * row['saturated']:>6.1f} %"
        )
    if len(metrics["joints"]) > _LISTED:
        lines.append(f"            and {len(metrics['joints']) - _LISTED} joints with less")
    return "\n".join(lines)


def _share(shares: Any) -> float | None:
    """The mean of what is known; None where no limit is."""
    known = shares[np.isfinite(shares)]
    return round(float(known.mean()), 5) if len(known) else None


def _mean(seeds: list[dict[str, Any]], key: str) -> float | None:
    values = [each[key] for each in seeds if each[key] is not None]
    return round(float(np.mean(values)), 5) if values else None


def _spread(seeds: list[dict[str, Any]], key: str, shape: str) -> str:
    """The mean, and the least and the most where they differ as they are shown."""
    values = [each[key] for each in seeds]
    mean, least, most = (f"{v:{shape}}" for v in (np.mean(values), min(values), max(values)))
    return mean if least == most else f"{mean} ({least} to {most})"
