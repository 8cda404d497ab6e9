"""Findings: what is wrong where and when, in sentences that one can act on."""

from collections.abc import Iterator

import numpy as np

from sim.report.clip_metrics import ClipMetrics
from sim.report.findings_beside import (
    Beside,
    base_findings,
    contact_findings,
    drift_findings,
    limb_findings,
    pose_findings,
    slide_findings,
    swing_findings,
)
from sim.report.hovers import HOVERS, Hover
from sim.report.result import Finding
from sim.report.tremble import Tremble
from spark.runs import true_runs

# Flagged frames of one measure that are no further apart than this [s] are one event to a viewer.
_MERGE_GAP = 0.1
# A foot that lands or leaves is faster for a moment than at rest, within the window of speeds. What
# slides no longer than that, and by less than this [m, of an adult], is nothing to mend.
_MIN_SLIDE = 0.015
# A joint beyond its limit by less than this [rad] is nothing to mend: the ranges are no finer.
_MIN_EXCESS = np.radians(1.0)


def findings_of(
    clip: ClipMetrics, tremble: Tremble, beside: Beside | None = None
) -> tuple[Finding, ...]:
    """All events of a clip, and those beside its source, the gravest of each measure first."""
    gap = int(_MERGE_GAP / clip.frame_time)
    measures = (
        _penetration,
        _floating,
        _skating,
        _root_wrench,
        _joint_limits,
        _self_penetration,
        _balance,
        _torque,
    )
    findings = (
        f for measure in measures for f in sorted(measure(clip, gap), key=lambda f: -f.amount)
    )
    return (
        *findings,
        *(_hovering(clip, 0.0, ()) if beside is None else _beside(clip, beside, gap)),
        *_tremble(tremble, gap),
        *_pops(tremble),
        *(() if beside is None else drift_findings(beside.drift)),
    )


def _beside(clip: ClipMetrics, beside: Beside, gap: int) -> Iterator[Finding]:
    # Of another motion, feet where the source's stand say nothing.
    other = beside.discord is not None and beside.discord.other_pose
    yield from _hovering(clip, beside.hover, () if other else beside.hovers)
    if not other:
        yield from slide_findings(beside.slides)
    # Where feet swing at other times, how high they are when the source's do says nothing.
    if beside.discord:
        yield from contact_findings(beside.discord)
    elif beside.swing:
        yield from swing_findings(beside.swing)
    yield from base_findings(clip, beside.thrown)
    if beside.limbs:
        yield from limb_findings(clip, beside.limbs, gap)
    if beside.pose:
        yield from pose_findings(beside.pose, clip.frame_time, gap)


def _penetration(clip: ClipMetrics, gap: int) -> Iterator[Finding]:
    for name in dict.fromkeys(clip.depth_names):
        depth = clip.depth[:, [n == name for n in clip.depth_names]].max(axis=1)
        for start, stop in true_runs(depth > clip.thresholds.penetration, gap):
            deepest = start + int(depth[start:stop].argmax())
            amount = float(depth[deepest])
            into = "under the floor" if clip.ground.terrain is None else "into the ground"
            sentence = f"{name} sinks {100 * amount:.1f} cm {into}"
            yield Finding("penetration", name, start, stop, amount, "m", sentence)


def _floating(clip: ClipMetrics, gap: int) -> Iterator[Finding]:
    for start, stop in true_runs(clip.flags["floating"], gap):
        amount = float(clip.clearance[start:stop].max())
        sentence = f"the body floats {100 * amount:.1f} cm above the floor"
        yield Finding("floating", "body", start, stop, amount, "m", sentence)


def _hovering(clip: ClipMetrics, source: float, hovers: tuple[Hover, ...]) -> Iterator[Finding]:
    """A body that is a little too high throughout, which no single frame shows; or else feet that
    are for a while."""
    height, limits = clip.hover, clip.thresholds
    if source + limits.of_adult(HOVERS) < height <= limits.floating:
        sentence = f"the body hovers: it keeps {100 * height:.1f} cm above the floor"
        yield Finding("floating", "body", 0, len(clip), height, "m", sentence)
        return
    for foot, start, stop, higher in sorted(hovers, key=lambda hover: -hover.height):
        sentence = (
            f"{foot} hovers: it is up to {100 * higher:.1f} cm higher above the floor than the "
            "source's, which stands"
        )
        yield Finding("floating", foot, start, stop, higher, "m", sentence)


def _skating(clip: ClipMetrics, gap: int) -> Iterator[Finding]:
    least = clip.thresholds.of_adult(_MIN_SLIDE)
    moment = round(clip.thresholds.window / clip.frame_time)
    for foot in dict.fromkeys(clip.corner_feet):
        columns = [f == foot for f in clip.corner_feet]
        speed = np.where(clip.corner_skates, clip.corner_speeds, 0.0)[:, columns].max(axis=1)
        for start, stop in true_runs(speed > 0, gap):
            amount = float(speed[start:stop].sum()) * clip.frame_time
            if amount < least and stop - start <= moment:
                continue
            sentence = f"{foot} slides {100 * amount:.1f} cm"
            yield Finding("skating", foot, start, stop, amount, "m", sentence)


def _root_wrench(clip: ClipMetrics, gap: int) -> Iterator[Finding]:
    force, torque = clip.unexplained_wrench.T
    for start, stop in true_runs(clip.flags["root_wrench"] & ~clip.flags["floating"], gap):
        amount, unit = float(force[start:stop].max()), "bw"
        sentence = f"the body is pushed by {amount:.2f} body weights that nothing gives"
        if amount <= clip.thresholds.wrench_force:
            amount, unit = float(torque[start:stop].max()), "bw_m"
            sentence = f"the body is turned by {amount:.2f} body weights x 1 m that nothing gives"
        yield Finding("root_wrench", "body", start, stop, amount, unit, sentence)


def _joint_limits(clip: ClipMetrics, gap: int) -> Iterator[Finding]:
    for limit in clip.limits:
        for excess, movement in zip(limit.excess.T, limit.movements, strict=True):
            for start, stop in true_runs(excess > 0, gap):
                amount = float(excess[start:stop].max())
                if amount < _MIN_EXCESS:
                    continue
                sentence = f"{limit.joint} {movement} {np.degrees(amount):.0f}° beyond its limit"
                yield Finding("joint_limit", limit.joint, start, stop, amount, "rad", sentence)


def _self_penetration(clip: ClipMetrics, gap: int) -> Iterator[Finding]:
    for (one, other), depth in zip(clip.self_pairs, clip.self_depth.T, strict=True):
        for start, stop in true_runs(depth > clip.self_bound, gap):
            amount = float(depth[start:stop].max())
            where = f"{one}, {other}"
            sentence = f"{one} and {other} go {100 * amount:.1f} cm into each other"
            yield Finding("self_penetration", where, start, stop, amount, "m", sentence)


def _balance(clip: ClipMetrics, gap: int) -> Iterator[Finding]:
    outside = np.nan_to_num(clip.imbalance)
    for start, stop in true_runs(outside > clip.thresholds.balance, gap):
        amount = float(outside[start:stop].max())
        sentence = f"the body stands still {100 * amount:.1f} cm beside its feet, and would tip"
        yield Finding("balance", "body", start, stop, amount, "m", sentence)


def _torque(clip: ClipMetrics, gap: int) -> Iterator[Finding]:
    for each in clip.torques:
        for start, stop in true_runs(each.load > clip.thresholds.torque, gap):
            amount = float(np.abs(each.torque[start:stop]).max())
            sentence = f"{each.joint} needs {amount:.0f} N m, its motor gives {each.limit:.0f}"
            yield Finding("torque", each.joint, start, stop, amount, "n_m", sentence)


def _tremble(tremble: Tremble, gap: int) -> Iterator[Finding]:
    """Of points, in the order of their names, then of joints, the gravest first."""
    parts = (
        (tremble.point_names, tremble.points, tremble.source_points, tremble.points_far, "m"),
        (tremble.joint_names, tremble.joints, tremble.source_joints, tremble.joints_far, "rad"),
    )
    for names, values, theirs, far, unit in parts:
        factor, shown = (1000.0, " mm") if unit == "m" else (float(np.degrees(1.0)), "°")
        findings = []
        for k, name in enumerate(names):
            for start, stop in true_runs(far[:, k], gap):
                amount = float(values[start:stop, k].max())
                sentence = f"{name} trembles by {factor * amount:.1f}{shown}"
                if theirs is not None:
                    sentence += f", the source's by {factor * theirs[start:stop, k].max():.1f}"
                findings.append(Finding("tremble", name, start, stop, amount, unit, sentence))
        yield from sorted(findings, key=lambda found: -found.amount)


def _pops(tremble: Tremble) -> Iterator[Finding]:
    for joint, frame, turn in tremble.pops:
        sentence = f"{joint} turns {np.degrees(turn):.0f}° in one frame"
        yield Finding("joint_speed", joint, frame, frame + 1, turn, "rad", sentence)
