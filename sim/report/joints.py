"""Joint by joint: limits, speed, jerk and torque in one row each."""

from collections import Counter
from dataclasses import dataclass

import numpy as np

from sim.report.clip_metrics import ClipMetrics
from sim.report.limits import LIMITS


@dataclass(frozen=True)
class JointRow:
    """One joint over a clip; None where it has no limit, or its file tells no torque.

    `room` [rad] is the least distance from a limit, negative beyond it; `at_limit` the share of
    frames at a limit or beyond. `speed` [rad/s] is the largest, `jerk` [rad/s³] and `rms` [N m]
    root mean squares, `torque` [N m] the largest and `load` that over what the motor gives.
    """

    name: str
    room: float | None
    at_limit: float | None
    speed: float
    jerk: float
    torque: float | None = None
    rms: float | None = None
    load: float | None = None


def joint_rows(clip: ClipMetrics) -> list[JointRow]:
    """A row for each joint whose rates are measured, in the body's order; those of one name are
    numbered."""
    limits = {_BONES.get(each.joint, each.joint): each for each in clip.limits}
    counts = Counter(clip.joint_names)
    seen: Counter[str] = Counter()
    torques = {each.joint: each for each in clip.torques}
    paces, rows = clip.joint_pace.max(axis=0), []
    for k, name in enumerate(clip.joint_names):
        # A rig's spine may have several joints of one name; its limit is that of the outermost.
        limit = limits.get(name) if name not in clip.joint_names[k + 1 :] else None
        torque = torques.get(name)
        seen[name] += 1
        rows.append(
            JointRow(
                name=name if counts[name] == 1 else f"{name} {seen[name]}",
                room=None if limit is None else -float(limit.beyond.max()),
                at_limit=None if limit is None else limit.at_limit_share,
                speed=float(paces[k]),
                jerk=float(np.sqrt(np.mean(clip.joint_jerk[:, k] ** 2))),
                torque=None if torque is None else float(np.abs(torque.torque).max()),
                rms=None if torque is None else float(np.sqrt(np.mean(torque.torque**2))),
                load=None if torque is None else float(torque.load.max()),
            )
        )
    return rows


_BONES = {
    limit.on(side): f"{side} {limit.role}".strip().replace("_", " ")
    for limit in LIMITS
    for side in limit.sides
}
"""What a rig's joint is called by its role, of each anatomical limit."""
