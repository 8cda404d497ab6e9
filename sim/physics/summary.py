"""What a simulated motion shows, as plain data for JSON and as text."""

from typing import Any

import numpy as np
from jaxtyping import Float

from sim.body.mj_joints import BALL, HINGE
from sim.interpolate import quaternions
from sim.physics.tracking import TrackingResult
from spark.constants import GRAVITY
from spark.rotation import quat_relative, rotvec_from_quat

SCHEMA = "spark-sim physics 3"
CARRIED = 0.1  # of its weight, in the mean: a body that the assist lifts by more hangs on it
LIMITS = (
    "This measures the servos as much as the motion: a fall shows that these servos don't keep "
    "this motion up, not that no controller could; an assist that carries weight hides feet in the "
    "air. Compare only what the same servos tracked."
)
BALANCED_LIMITS = (
    "This measures the controller as much as the motion: a fall shows that its tries found no way "
    "to keep this motion up, not that there is none. It looks ahead in the simulation itself, and "
    "falls are taken back: no machine can do that, but its motors can do what is shown."
)
_LISTED = 8  # joints and bodies in the text: the most loaded ones


def summarize(tracked: TrackingResult) -> dict[str, Any]:
    """The measures as JSON: lengths in cm, angles in degrees, efforts as shares of body weight (and
    height), torques in N m. Errors and what the assist carries are those before the fall.

    `verdict` is what came of it: `stays_up`, without assist; `helped` or `carried` by an assist
    that lifts less or more than `CARRIED` of the weight; `falls`; `diverged`. `upright_s` is the
    time until the body falls, whatever holds it; `stays_up_s` the same, None where it is carried.
    `taken_back_s` are the times of falls before which the simulation went back, and tried again.
    """
    rollout, model = tracked.rollout, tracked.model
    frames = len(rollout.fallen)
    weight = tracked.mass * GRAVITY
    falls = np.flatnonzero(rollout.fallen)
    fall = int(falls[0]) if len(falls) else None
    upright = slice(0, max(fall, 1) if fall is not None else frames)
    apart = rollout.points[upright] - tracked.target_points[upright]
    forces, torques = np.split(rollout.wrench[1:], 2, axis=1)
    lifted = np.maximum(rollout.wrench[upright, 2][1:], 0.0)
    assist: dict[str, Any] | None = None
    if tracked.assist is not None:
        assist = {
            "cap_force": tracked.assist.force,
            "cap_torque": tracked.assist.torque,
            "force": _mean_and_max_norm(forces / weight),
            "carried": _reduced(lifted / weight, np.mean),
            "torque": _mean_and_max_norm(torques / (weight * tracked.height)),
            "work_j": round(float(rollout.work.sum()), 3),
        }
    loads = rollout.loads / weight
    verdict = _verdict(tracked.diverged, fall, assist)
    upright_s = round((fall if fall is not None else frames - 1) * tracked.frame_time, 4)
    return {
        "schema": SCHEMA,
        "frames": frames,
        "frame_time": tracked.frame_time,
        "mass_kg": round(tracked.mass, 3),
        "height_m": round(tracked.height, 4),
        "balanced": tracked.balanced,
        "verdict": verdict,
        "upright_s": upright_s,
        "stays_up_s": None if verdict == "carried" else upright_s,
        "fall_frame": fall,
        "diverged_frame": tracked.diverged,
        "taken_back_s": [round(t * tracked.frame_time, 4) for t in tracked.taken_back],
        "error": {
            "joints_deg": _rms(np.degrees(_joint_errors(tracked, upright))),
            "mpjpe_cm": _mean_norm(100 * apart),
            "mpjpe_root_cm": _mean_norm(100 * (apart - apart[:, :1])),
            "furthest_cm": max(_mean_norm(100 * each[None]) for each in apart),
        },
        "assist": assist,
        "joints": [
            {
                "name": model.joint(j).name,
                "peak_nm": round(float(rollout.peak[:, j].max()), 3),
                "rms_nm": round(float(np.sqrt(_reduced(rollout.square[1:, j], np.mean))), 3),
                "saturated": _reduced(rollout.saturated[1:, j], np.mean),
            }
            for j in np.argsort(-rollout.peak.max(0), kind="stable")
            if rollout.peak[:, j].max() > 0
        ],
        "floor": [
            {
                "body": model.body(b).name,
                "share": round(float((loads[:, b] > 0).mean()), 4),
                "peak": round(float(loads[:, b].max()), 4),
            }
            for b in np.argsort(-loads.sum(0), kind="stable")
            if loads[:, b].any()
        ],
        "notes": list(tracked.notes),
        "limits": BALANCED_LIMITS if tracked.balanced else LIMITS,
    }


def render(metrics: dict[str, Any], name: str) -> str:
    """The text of the `metrics` that `summarize` yields, of the motion `name`."""
    assist, error = metrics["assist"], metrics["error"]
    end = (metrics["frames"] - 1) * metrics["frame_time"]
    lifts = f"the assist lifts {100 * assist['carried']:.0f} % of its weight" if assist else ""
    away = f", at most {error['furthest_cm']:.0f} cm from the motion"
    verdict = {
        "stays_up": f"all {end:.2f} s{away}",
        "helped": f"upright for all {end:.2f} s{away}; {lifts}",
        "carried": f"for all {end:.2f} s it hangs on the assist, and does not stay up: {lifts}",
        "falls": f"after {metrics['upright_s']:.2f} s of {end:.2f} s, at frame "
        f"{metrics['fall_frame']}" + (f"; until then {lifts}" if assist else ""),
        "diverged": f"at frame {metrics['diverged_frame']}; no numbers after it",
    }[metrics["verdict"]]
    lines = [
        f"{name}: tracked in simulation, {'balanced, ' * metrics['balanced']}"
        f"{'with' if assist else 'without'} assist",
        f"  {metrics['verdict'].replace('_', ' '):<8}  {verdict}",
        f"  error     {error['joints_deg']:.1f} deg RMS of the joints; joints "
        f"{error['mpjpe_cm']:.1f} cm away, {error['mpjpe_root_cm']:.1f} cm relative to the root"
        + ("" if metrics["fall_frame"] is None else " (until the fall)"),
    ]
    falls = metrics["taken_back_s"]
    if falls:
        lines.append(
            f"  tried     {len(falls)} falls were taken back, between {min(falls):.2f} and "
            f"{max(falls):.2f} s: what is shown is the last try"
        )
    if assist:
        force, torque = assist["force"], assist["torque"]
        lines += [
            f"  assist    force {100 * force['mean']:.0f} % of body weight, at most "
            f"{100 * force['max']:.0f} % (cap {100 * assist['cap_force']:.0f} %)",
            f"            torque {100 * torque['mean']:.1f} % of body weight x height, at most "
            f"{100 * torque['max']:.1f} % (cap {100 * assist['cap_torque']:.0f} %); work "
            f"{assist['work_j']:.0f} J",
        ]
    touched = metrics["floor"]
    for k, each in enumerate(touched[:_LISTED]):
        lines.append(
            f"  {'floor' if not k else '':<9} {each['body']:<26} {100 * each['share']:5.1f} % of "
            f"frames, up to {each['peak']:.1f} body weights"
        )
    if not touched:
        lines.append("  floor     not touched")
    rows = metrics["joints"][:_LISTED]
    if rows:
        lines.append(f"  torque    {'joint':<26} {'peak N m':>9} {'RMS N m':>9} {'at limit':>9}")
    lines += [
        f"            {row['name']:<26} {row['peak_nm']:>9.1f} {row['rms_nm']:>9.1f} "
        f"{100 * row['saturated']:>7.1f} %"
        for row in rows
    ]
    if len(metrics["joints"]) > len(rows):
        lines.append(f"            and {len(metrics['joints']) - len(rows)} joints with less")
    return "\n".join(lines)


def _verdict(diverged: int | None, fall: int | None, assist: dict[str, Any] | None) -> str:
    if diverged is not None:
        return "diverged"
    if fall is not None:
        return "falls"
    if assist is None:
        return "stays_up"
    return "carried" if assist["carried"] > CARRIED else "helped"


def _joint_errors(tracked: TrackingResult, frames: slice) -> Float[np.ndarray, "T N"]:
    """How far each hinge and each ball is from its target [rad]."""
    model = tracked.model
    made, wanted = tracked.rollout.qpos[frames], tracked.target.qpos[frames]
    inside = _driven_joints(tracked)
    hinges = [int(model.jnt_qposadr[j]) for j in inside if int(model.jnt_type[j]) == HINGE]
    starts = {int(model.jnt_qposadr[j]) for j in inside if int(model.jnt_type[j]) == BALL}
    balls = np.array([q for q in quaternions(model) if int(q[0]) in starts], dtype=int)
    balls = balls.reshape(-1, 4)
    turns = rotvec_from_quat(quat_relative(wanted[:, balls], made[:, balls]))
    angles = np.abs(made[:, hinges] - wanted[:, hinges])
    return np.concatenate([angles, np.linalg.norm(turns, axis=-1)], axis=1)


def _driven_joints(tracked: TrackingResult) -> list[int]:
    """The joints that have a servo."""
    model = tracked.model
    return sorted({int(model.actuator_trnid[a, 0]) for a in range(model.nu)})


def _mean_and_max_norm(vectors: Float[np.ndarray, "T 3"]) -> dict[str, float]:
    sizes = np.linalg.norm(vectors, axis=-1)
    return {"mean": _reduced(sizes, np.mean), "max": _reduced(sizes, np.max)}


def _mean_norm(vectors: Float[np.ndarray, "T B 3"]) -> float:
    return round(float(np.linalg.norm(vectors, axis=-1).mean()), 4)


def _rms(values: Float[np.ndarray, "T N"]) -> float:
    return round(float(np.sqrt((values**2).mean())), 4) if values.size else 0.0


def _reduced(values: Float[np.ndarray, "T"], of: Any) -> float:
    """`of(values)`, rounded; 0 where there are none: a single frame has no efforts."""
    return round(float(of(values)), 5) if len(values) else 0.0
