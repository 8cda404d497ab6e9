"""The report as text."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from sim.report.clip_metrics import ClipMetrics
from sim.report.names import LABELS, UNITS
from sim.report.palette import BOLD, DIM, TERMINAL, grade
from sim.report.pose_error import PoseError
from sim.report.result import Finding, Result
from sim.report.table import RATES, shares, source_rate
from sim.report.tremble import Tremble
from spark.summary import counted

_SHOWN = 3  # findings of one measure
_RATE_KINDS = {
    "base_acceleration": "at most in 99 % of the frames",
    "joint_speed": "at most",
    "joint_jerk": "RMS",
}


def render(result: Result, *, color: bool) -> str:
    """Headline, parts, what to mend, and what was assumed."""

    def paint(text: str, *codes: int) -> str:
        return f"\x1b[{';'.join(map(str, codes))}m{text}\x1b[0m" if color else text

    def graded(percent: float, text: str) -> str:
        return paint(text, TERMINAL[grade(percent)])

    clip, source = result.clip, result.source
    duration = (len(clip) - 1) * clip.frame_time
    implausible = 100 * result.implausible
    headline = f"{implausible:.1f} % of the frames are implausible"
    beside = "" if source is None else f"; of the source's {100 * source.implausible_share:.1f} %"
    lines = [
        f"{paint(graded(implausible, headline), BOLD)}{beside}",
        paint(f"{counted(len(clip), 'frame')}, {duration:.1f} s", DIM),
        "",
    ]
    theirs = {} if source is None else shares(source)
    for measure, percent in shares(clip).items():
        if percent is None:
            continue
        line = f"  {LABELS[measure]:<18}{graded(percent, f'{percent:>6.1f} %')}"
        if (their := theirs.get(measure)) is not None:
            line += f"   source {their:>6.1f} %"
        lines.append(line + (f"   {base}" if (base := share_base(clip, measure)) else ""))
    lines += [f"  {detail.label:<18}{detail.words}" for detail in details(result)]
    lines += ["", *_verdict(result.findings, clip.frame_time)]
    if result.notes:
        lines += ["", *(paint(f"note: {note}", DIM) for note in result.notes)]
    return "\n".join([*lines, paint(clip.thresholds.version, DIM)])


def _verdict(findings: tuple[Finding, ...], frame_time: float) -> list[str]:
    if not findings:
        return ["nothing to mend"]
    lines = ["to mend:"]
    for measure in dict.fromkeys(finding.measure for finding in findings):
        group = [finding for finding in findings if finding.measure == measure]
        lines += [f"  {f.sentence} {f.place(frame_time)}" for f in group[:_SHOWN]]
        if len(group) > _SHOWN:
            lines.append(f"  ... and {len(group) - _SHOWN} more of {LABELS[measure]}")
    return lines


def share_base(clip: ClipMetrics, measure: str) -> str:
    """What a share is of, where that isn't all frames."""
    if measure != "balance":
        return ""
    at_rest = 100 * float(np.isfinite(clip.imbalance).mean())
    return f"of the {at_rest:.1f} % of the frames in which the body rests"


class Detail(NamedTuple):
    """A measure that is no share of frames: its name, its label, and its value in words."""

    measure: str
    label: str
    words: str


def details(result: Result) -> Iterator[Detail]:
    """All of them that the result has."""
    clip, drift, contacts = result.clip, result.drift, result.contacts
    highest = max(clip.torques, key=lambda each: each.load.max(), default=None)
    if highest is not None:
        load = 100 * float(highest.load.max())
        yield Detail(
            "torque",
            "highest torque",
            f"{load:>6.0f} %        of what {highest.joint}'s motor gives, {highest.limit:.0f} N m",
        )
    often = sorted(clip.at_limit_shares.items(), key=lambda item: -item[1])[:_SHOWN]
    if often and often[0][1] > 0:
        others = "".join(f"; {joint} {100 * share:.1f} %" for joint, share in often[1:] if share)
        longest = clip.longest_at_limit(often[0][0])
        words = (
            f"{100 * often[0][1]:>6.1f} %        {often[0][0]}, for {longest:.1f} s on end{others}"
        )
        yield Detail("at_limit", "most at a limit", words)
    if contacts is not None and contacts.f1 is not None:
        parts = (("precision", contacts.precision), ("recall", contacts.recall))
        words = "".join(f"; {name} {part:.2f}" for name, part in parts if part is not None)
        words = f"{contacts.f1:>6.2f}          F1 against the source{words}"
        yield Detail("contacts", "foot contacts", words)
    if result.swing is not None:
        swing = result.swing
        yield Detail(
            "swing_clearance",
            "swing clearance",
            f"{swing.clearance:>6.2f}          of the source's: {100 * swing.height:.1f} cm where "
            f"its feet pass {100 * swing.source_height:.1f} cm above the floor, scaled",
        )
    if result.pose is not None:
        yield Detail("pose", LABELS["pose"], _pose(result.pose))
    yield Detail("tremble", LABELS["tremble"], _tremble(result.tremble))
    if drift is not None:
        yield Detail(
            "root_drift",
            LABELS["root_drift"],
            f"{drift.distance.max():>6.2f} m        at most; {drift.distance[-1]:.2f} m at the end "
            f"of a path of {drift.path_length:.1f} m; heading "
            f"{np.degrees(np.abs(drift.heading).max()):.0f}° at most",
        )
    if result.truth is not None:
        truth = result.truth
        yield Detail(
            "ground_truth",
            "ground truth",
            f"{truth.mpjpe:>6.2f} %        of the height away in the mean; MSE {truth.mse:.2g}, "
            f"root-relative {truth.relative_mse:.2g}",
        )
    for measure, kind in _RATE_KINDS.items():
        unit, value = UNITS[measure], RATES[measure]
        theirs = source_rate(result, measure)
        scaled = ", scaled" if measure == "base_acceleration" else ""
        beside = "" if theirs is None else f"; source {theirs:.0f}{scaled}"
        words = f"{value(clip):>6.0f} {unit:<6}   {kind}{beside}"
        yield Detail(measure, LABELS[measure], words)
        if measure == "base_acceleration" and clip.limb_names:
            yield Detail("limb_acceleration", LABELS["limb_acceleration"], _limbs(result))


def _pose(pose: PoseError) -> str:
    """The mean of all parts, and the part that is off most."""
    means = np.degrees(pose.means)
    worst = int(means.argmax())
    most = float(np.degrees(pose.angles[:, worst].max()))
    return (
        f"{np.degrees(pose.mean):>6.1f}°         off the source's in the mean; most the "
        f"{pose.parts[worst].name}, {means[worst]:.0f}°, {most:.0f}° at most"
    )


def _tremble(tremble: Tremble) -> str:
    """The point and the joint that tremble most, in their worst half seconds."""
    point, joint = (int(each.max(axis=0).argmax()) for each in (tremble.points, tremble.joints))
    theirs = their_turn = ""
    if tremble.source_points is not None and tremble.source_joints is not None:
        theirs = f", the source's {1000 * tremble.source_points.max():.1f}, scaled"
        their_turn = f", the source's {np.degrees(tremble.source_joints.max()):.1f}"
    return (
        f"{1000 * tremble.largest:>6.1f} mm       {tremble.point_names[point]}, in the worst half "
        f"second{theirs}; of joints the {tremble.joint_names[joint]}, by "
        f"{np.degrees(tremble.joints.max()):.1f}°{their_turn}"
    )


def _limbs(result: Result) -> str:
    """The worst limb beside the source's, and when; without a source the fastest."""
    clip, limbs = result.clip, result.limbs
    if limbs is None:
        peaks = clip.limb_peaks
        hardest = int(peaks.argmax())
        name = clip.limb_names[hardest]
        return f"{peaks[hardest]:>6.0f} m/s²     {name}, at most in 99 % of the frames"
    worst, frame = limbs.worst, limbs.worst_frame
    return (
        f"{limbs.ratio:>6.2f}          of the source's: {limbs.names[worst]}, "
        f"{limbs.peaks[worst]:.1f} m/s², the source's {limbs.source_peaks[worst]:.1f}, scaled; "
        f"worst at {frame * clip.frame_time:.2f} s"
    )
