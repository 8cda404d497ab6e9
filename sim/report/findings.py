"""Findings: what is wrong where and when, in sentences that one can act on."""

from collections.abc import Iterator

import numpy as np

from sim.report.clip_metrics import ClipMetrics
from sim.report.contact_timing import Discord
from sim.report.limbs import Limbs
from sim.report.measures import Drift
from sim.report.pose_error import PoseError
from sim.report.result import Finding
from sim.report.swing import Swing
from sim.report.tremble import Tremble
from spark.constants import GRAVITY
from spark.runs import true_runs

# Flagged frames of one measure that are no further apart than this [s] are one event to a viewer.
_MERGE_GAP = 0.1
# A joint beyond its limit by less than this [rad] is nothing to mend: the ranges are no finer.
_MIN_EXCESS = np.radians(1.0)
# The root strays where it is further from the source's path than this share of the path's length,
# counted as 1 m at least; and where its heading differs by more than this [rad].
_MAX_DRIFT, _MAX_HEADING = 0.05, np.radians(10)
# Feet pass too low or too high where their clearance is outside these bounds, and the base is
# thrown where its acceleration is more than this many times the source's: in both, what captured
# people differ by between two takes of one motion is within.
_CLEARANCE, _MAX_THROW = (0.7, 1.4), 1.5
# A part points elsewhere where it does for so long [s]: a fast one passes by a little late.
_LASTS = 0.2
# And in the mean over all frames [rad], but for feet, which other soles tilt: of 20 results on a G1
# a boxer's hands reach 14 degrees.
_ELSEWHERE = np.radians(16)


def findings_of(
    clip: ClipMetrics,
    tremble: Tremble,
    drift: Drift | None = None,
    swing: Swing | None = None,
    thrown: float | None = None,
    limbs: Limbs | None = None,
    pose: PoseError | None = None,
    discord: Discord | None = None,
) -> tuple[Finding, ...]:
    """All events of a clip, the gravest of each measure first.

    `thrown` [m/s²] is the 99th percentile of the source's base acceleration, scaled.
    """
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
        *(_contacts(discord) if discord else ()),
        # Where feet swing at other times, how high they are when the source's do says nothing.
        *(_swing(swing) if swing and not discord else ()),
        *(_base(clip, thrown) if thrown is not None else ()),
        *(_limbs(clip, limbs, gap) if limbs else ()),
        *(_pose(pose, clip.frame_time, gap) if pose else ()),
        *_tremble(tremble, gap),
        *_pops(tremble),
        *(_root_drift(drift) if drift else ()),
    )


def _penetration(clip: ClipMetrics, gap: int) -> Iterator[Finding]:
    for name in dict.fromkeys(clip.depth_names):
        depth = clip.depth[:, [n == name for n in clip.depth_names]].max(axis=1)
        for start, stop in true_runs(depth > clip.thresholds.penetration, gap):
            deepest = start + int(depth[start:stop].argmax())
            amount = float(depth[deepest])
            sentence = f"{name} sinks {100 * amount:.1f} cm under the floor"
            yield Finding("penetration", name, start, stop, amount, "m", sentence)


def _floating(clip: ClipMetrics, gap: int) -> Iterator[Finding]:
    for start, stop in true_runs(clip.flags["floating"], gap):
        amount = float(clip.clearance[start:stop].max())
        sentence = f"the body floats {100 * amount:.1f} cm above the floor"
        yield Finding("floating", "body", start, stop, amount, "m", sentence)


def _skating(clip: ClipMetrics, gap: int) -> Iterator[Finding]:
    for foot in dict.fromkeys(clip.corner_feet):
        columns = [f == foot for f in clip.corner_feet]
        speed = np.where(clip.corner_skates, clip.corner_speeds, 0.0)[:, columns].max(axis=1)
        for start, stop in true_runs(speed > 0, gap):
            amount = float(speed[start:stop].sum()) * clip.frame_time
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


def _contacts(discord: Discord) -> Iterator[Finding]:
    precision, recall, f1 = (
        discord.match.precision or 0.0,
        discord.match.recall or 0.0,
        discord.match.f1 or 0.0,
    )
    measure = "missed_contact" if recall < precision else "invented_contact"
    yield Finding(measure, "feet", discord.start, discord.stop, f1, "f1", discord.words)


def _swing(swing: Swing) -> Iterator[Finding]:
    low, high = _CLEARANCE
    if low <= swing.clearance <= high:
        return
    sign = 1.0 if swing.clearance < low else -1.0
    off = np.nan_to_num(sign * swing.deficit, nan=-np.inf)
    worst, foot = np.unravel_index(int(off.argmax()), off.shape)
    amount, word = float(off[worst, foot]), "lower" if sign > 0 else "higher"
    sentence = (
        f"feet clear the floor by {swing.clearance:.2f} of the source's in swing; the "
        f"{swing.feet[foot]} passes {100 * amount:.1f} cm {word} than it"
    )
    yield Finding(
        "swing_clearance", swing.feet[foot], int(worst), int(worst) + 1, amount, "m", sentence
    )


def _base(clip: ClipMetrics, thrown: float) -> Iterator[Finding]:
    found = clip.base_acceleration_p99
    # In a source that hardly moves, half of gravity is nothing to be thrown by.
    if found <= max(_MAX_THROW * thrown, 0.5 * GRAVITY):
        return
    worst = int(clip.base_acceleration.argmax())
    amount = float(clip.base_acceleration[worst])
    sentence = f"the base is thrown by {amount:.0f} m/s², the source's by {thrown:.0f}"
    yield Finding("base_acceleration", "root", worst, worst + 1, amount, "m_s2", sentence)


def _limbs(clip: ClipMetrics, limbs: Limbs, gap: int) -> list[Finding]:
    findings = []
    for k, (name, peak) in enumerate(zip(limbs.names, limbs.source_peaks, strict=True)):
        own = clip.limb_acceleration[:, clip.limb_names.index(name)]
        for start, stop in true_runs(limbs.thrown[:, k], gap):
            amount = float(own[start:stop].max())
            sentence = f"{name} is thrown by {amount:.1f} m/s², the source's by {peak:.1f}"
            findings.append(
                Finding("limb_acceleration", name, start, stop, amount, "m_s2", sentence)
            )
    return sorted(findings, key=lambda found: -found.amount)


def _pose(pose: PoseError, frame_time: float, gap: int) -> list[Finding]:
    findings = []
    for part, angles, far in zip(pose.parts, pose.angles.T, pose.far.T, strict=True):
        for start, stop in true_runs(far, gap):
            if (stop - start) * frame_time < _LASTS:
                continue
            amount = float(angles[start:stop].max())
            turned = "is turned" if part.kind == "hand" else "points"
            sentence = f"{part.name} {turned} {np.degrees(amount):.0f}° away from the source's"
            findings.append(Finding("pose", part.name, start, stop, amount, "rad", sentence))
    named = {finding.where for finding in findings}
    for part, mean in zip(pose.parts, pose.means, strict=True):
        if part.kind != "foot" and part.name not in named and mean > _ELSEWHERE:
            turned = "is turned" if part.kind == "hand" else "points"
            sentence = (
                f"{part.name} {turned} {np.degrees(mean):.0f}° away from the source's in the mean"
            )
            count = len(pose.angles)
            findings.append(Finding("pose", part.name, 0, count, float(mean), "rad", sentence))
    return sorted(findings, key=lambda found: -found.amount)


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


def _root_drift(drift: Drift) -> Iterator[Finding]:
    worst = int(drift.distance.argmax())
    amount = float(drift.distance[worst])
    if amount > _MAX_DRIFT * max(drift.path_length, 1.0):
        sentence = f"the root strays {amount:.2f} m from the source's path"
        yield Finding("root_drift", "root", worst, worst + 1, amount, "m", sentence)
    worst = int(np.abs(drift.heading).argmax())
    amount = float(np.abs(drift.heading[worst]))
    if amount > _MAX_HEADING:
        sentence = f"the heading is {np.degrees(amount):.0f}° off the source's"
        yield Finding("root_drift", "heading", worst, worst + 1, amount, "rad", sentence)
