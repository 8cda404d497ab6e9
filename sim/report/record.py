"""The report as plain data for JSON."""

from dataclasses import asdict
from typing import Any

import numpy as np

from sim.report.clip_metrics import ClipMetrics
from sim.report.joints import joint_rows
from sim.report.limbs import Limbs
from sim.report.measures import Drift
from sim.report.pose_error import PoseError
from sim.report.result import Finding, Result
from sim.report.swing import Swing
from sim.report.tremble import Tremble
from sim.report.truth import Accuracy
from spark.runs import true_runs

SCHEMA = "spark-sim report 1"


def record(result: Result) -> dict[str, Any]:
    """Numbers in SI, units in the keys; frames count from 0 and spans are [start, stop)."""
    clip = result.clip
    return {
        "schema": SCHEMA,
        "thresholds": clip.thresholds.version,
        "threshold_values": _threshold_values(clip),
        "frames": len(clip),
        "frame_time_s": clip.frame_time,
        "implausible_share": result.implausible,
        "clip": _clip(clip),
        "source": None if result.source is None else _clip(result.source),
        "difference_to_source": None if result.source is None else _difference(result),
        "pose_error": None if result.pose is None else _pose(result.pose),
        "tremble": _tremble(result.tremble),
        "root_drift": None if result.drift is None else _drift(result.drift),
        "foot_contacts": None if result.contacts is None else asdict(result.contacts),
        "swing": None if result.swing is None else _swing(result.swing),
        "limbs": None if result.limbs is None else _limbs(result.limbs, clip.frame_time),
        "ground_truth": None if result.truth is None else _truth(result.truth),
        "findings": [_finding(finding, clip.frame_time) for finding in result.findings],
        "notes": list(result.notes),
    }


_UNITS = {
    "penetration": "m",
    "floating": "m",
    "free_fall": "m_s2",
    "skate_height": "m",
    "skate_speed": "m_s",
    "skate_load": "bw",
    "wrench_force": "bw",
    "wrench_torque": "bw_m",
    "contact_height": "m",
    "friction": "",
    "self_penetration": "m",
    "shape_penetration": "m",
    "stand_height": "m",
    "swing_speed": "m_s",
    "swing_height": "m",
    "swing_time": "s",
    "limb_throw": "",
    "limb_least": "m_s2",
    "torque": "",
    "limit_margin": "rad",
    "limit_margin_share": "",
    "static_speed": "m_s",
    "static_acceleration": "m_s2",
    "static_time": "s",
    "balance": "m",
    "window": "s",
}


def _threshold_values(clip: ClipMetrics) -> dict[str, float]:
    values = asdict(clip.thresholds)
    return {f"{name}_{unit}" if unit else name: values[name] for name, unit in _UNITS.items()}


def _clip(clip: ClipMetrics) -> dict[str, Any]:
    return {
        "implausible_share": clip.implausible_share,
        "floor_z_m": clip.floor_z,
        "flags": {
            name: {
                "share": clip.shares[name],
                "spans": [list(span) for span in true_runs(flag)],
            }
            for name, flag in clip.flags.items()
        },
        "deepest_m": float(clip.depth.max()),
        "highest_clearance_m": float(clip.clearance.max()),
        "fastest_skate_m_s": float(np.where(clip.corner_skates, clip.corner_speeds, 0.0).max()),
        "largest_unexplained_force_bw": float(clip.unexplained_wrench[:, 0].max()),
        "largest_unexplained_torque_bw_m": float(clip.unexplained_wrench[:, 1].max()),
        "joint_limit_share": clip.limit_share,
        "at_limit_share": clip.at_limit_share,
        "self_penetration_share": float(clip.self_penetration.mean()),
        "deepest_self_penetration_m": float(clip.self_depth.max(initial=0.0)),
        "unbalanced_share_of_static": clip.unbalanced_share,
        "static_share": float(np.isfinite(clip.imbalance).mean()),
        "over_torque_share": clip.overload_share,
        "base_acceleration_p99_m_s2": clip.base_acceleration_p99,
        "limb_acceleration_p99_m_s2": dict(
            zip(clip.limb_names, clip.limb_peaks.tolist(), strict=True)
        ),
        "largest_joint_speed_rad_s": float(clip.joint_pace.max(initial=0.0)),
        "joint_jerk_rms_rad_s3": clip.jerk_rms,
        "joint_limits": {
            limit.joint: {
                "share": limit.share,
                "at_limit_share": limit.at_limit_share,
                "largest_excess_rad": float(limit.excess.max()),
            }
            for limit in clip.limits
        },
        "joint_rates": {
            row.name: {"largest_speed_rad_s": row.speed, "jerk_rms_rad_s3": row.jerk}
            for row in joint_rows(clip)
        },
        "joint_torques": {
            each.joint: {
                "limit_n_m": each.limit,
                "largest_n_m": float(np.abs(each.torque).max()),
                "rms_n_m": float(np.sqrt(np.mean(each.torque**2))),
                "over_share": float((each.load > clip.thresholds.torque).mean()),
            }
            for each in clip.torques
        },
    }


def _difference(result: Result) -> dict[str, float]:
    assert result.source is not None
    ours, theirs = result.clip.shares, result.source.shares
    shares = {f"{name}_share": ours[name] - theirs[name] for name in ours}
    return {"implausible_share": result.implausible - result.source.implausible_share, **shares}


def _drift(drift: Drift) -> dict[str, Any]:
    length = drift.path_length
    return {
        "largest_m": float(drift.distance.max()),
        "final_m": float(drift.distance[-1]),
        "source_path_m": length,
        "final_share_of_path": float(drift.distance[-1] / length) if length > 0 else None,
        "largest_heading_rad": float(np.abs(drift.heading).max()),
        "final_heading_rad": float(drift.heading[-1]),
    }


def _swing(swing: Swing) -> dict[str, float]:
    return {
        "clearance_of_source": swing.clearance,
        "height_m": swing.height,
        "scaled_source_height_m": swing.source_height,
        "swing_s": swing.seconds,
    }


def _limbs(limbs: Limbs, frame_time: float) -> dict[str, Any]:
    return {
        "acceleration_of_source": limbs.ratio,
        "worst": limbs.names[limbs.worst],
        "worst_frame": limbs.worst_frame,
        "worst_s": limbs.worst_frame * frame_time,
        "of_source": dict(zip(limbs.names, limbs.ratios.tolist(), strict=True)),
        "scaled_source_p99_m_s2": dict(zip(limbs.names, limbs.source_peaks.tolist(), strict=True)),
    }


def _pose(pose: PoseError) -> dict[str, Any]:
    largest = pose.angles.max(axis=0)
    return {
        "mean_rad": pose.mean,
        "parts": {
            part.name: {"mean_rad": float(mean), "largest_rad": float(most)}
            for part, mean, most in zip(pose.parts, pose.means, largest, strict=True)
        },
    }


def _tremble(tremble: Tremble) -> dict[str, Any]:
    kept = (
        ("points_m", tremble.point_names, tremble.points),
        ("scaled_source_points_m", tremble.point_names, tremble.source_points),
        ("joints_rad", tremble.joint_names, tremble.joints),
        ("source_joints_rad", tremble.joint_names, tremble.source_joints),
    )
    largest = {
        key: None if each is None else dict(zip(names, each.max(axis=0).tolist(), strict=True))
        for key, names, each in kept
    }
    return {"largest_m": tremble.largest, **largest}


def _truth(truth: Accuracy) -> dict[str, float]:
    return {
        "mse": truth.mse,
        "root_relative_mse": truth.relative_mse,
        "mpjpe_percent_of_height": truth.mpjpe,
        "largest_error_percent_of_height": float(truth.errors.max()),
    }


def _finding(finding: Finding, frame_time: float) -> dict[str, Any]:
    return {
        "measure": finding.measure,
        "where": finding.where,
        "start_frame": finding.start,
        "stop_frame": finding.stop,
        "start_s": finding.start * frame_time,
        f"amount_{finding.unit}": finding.amount,
        "text": f"{finding.sentence} {finding.place(frame_time)}",
    }
