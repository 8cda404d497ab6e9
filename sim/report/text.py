"""The report as text."""

from collections.abc import Iterator

import numpy as np

from sim.report.clip_metrics import FLAGS, ClipMetrics
from sim.report.result import Finding, Report

_RED, _YELLOW, _GREEN, _DIM, _BOLD = 31, 33, 32, 2, 1
_SHOWN = 3  # of the findings of one measure


def render(report: Report, *, color: bool) -> str:
    """Headline, parts, what to mend, and what was assumed."""

    def paint(text: str, *codes: int) -> str:
        return f"\x1b[{';'.join(map(str, codes))}m{text}\x1b[0m" if color else text

    def graded(share: float, text: str) -> str:
        return paint(text, _GREEN if share <= 0.01 else _YELLOW if share <= 0.05 else _RED)

    clip, source = report.clip, report.source
    duration = (len(clip) - 1) * clip.frame_time
    headline = f"{_percent(report.implausible)} of the frames are implausible"
    beside = "" if source is None else f"; of the source's {_percent(source.implausible_share)}"
    lines = [
        f"{paint(graded(report.implausible, headline), _BOLD)}{beside}",
        paint(f"{len(clip)} frames, {duration:.1f} s", _DIM),
        "",
    ]
    theirs = {} if source is None else dict(shares(source))
    for name, share in shares(clip):
        line = f"  {name:<18}{graded(share, f'{_percent(share):>8}')}"
        line += f"   source {_percent(theirs[name]):>8}" if name in theirs else ""
        lines.append(line + (f"   {rest}" if (rest := of_which(clip, name)) else ""))
    lines += [f"  {name:<18}{words}" for name, words in figures(report)]
    lines += ["", *_verdict(report.findings, clip.frame_time)]
    if report.notes:
        lines += ["", *(paint(f"note: {note}", _DIM) for note in report.notes)]
    return "\n".join([*lines, paint(clip.thresholds.version, _DIM)])


def _verdict(findings: tuple[Finding, ...], frame_time: float) -> list[str]:
    if not findings:
        return ["nothing to mend"]
    lines = ["to mend:"]
    for measure in dict.fromkeys(finding.measure for finding in findings):
        group = [finding for finding in findings if finding.measure == measure]
        lines += [f"  {f.sentence} {f.place(frame_time)}" for f in group[:_SHOWN]]
        if len(group) > _SHOWN:
            lines.append(f"  ... and {len(group) - _SHOWN} more of {measure}")
    return lines


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def shares(clip: ClipMetrics) -> Iterator[tuple[str, float]]:
    """The measures that are shares of frames, by name."""
    for letter, name in FLAGS.items():
        yield name, clip.shares[letter]
    yield "joint limits", clip.limit_share
    yield "at a limit", clip.at_limit_share
    yield "self-penetration", float(clip.self_penetration.mean())
    if clip.unbalanced_share is not None:
        yield "out of balance", clip.unbalanced_share


def of_which(clip: ClipMetrics, name: str) -> str:
    """What a share is of, where that isn't all frames."""
    if name != "out of balance":
        return ""
    return f"of those at rest, {_percent(float(np.isfinite(clip.imbalance).mean()))} of all"


def figures(report: Report) -> Iterator[tuple[str, str]]:
    """The other measures, by name, in words."""
    clip, source, drift, contacts = report.clip, report.source, report.drift, report.contacts
    often = sorted(clip.at_limit_shares.items(), key=lambda item: -item[1])[:_SHOWN]
    if often and often[0][1] > 0:
        others = "".join(f"; {joint} {_percent(share)}" for joint, share in often[1:] if share > 0)
        yield "most at a limit", f"{100 * often[0][1]:>6.1f} %        {often[0][0]}{others}"
    if contacts is not None and contacts.f1 is not None:
        parts = (("precision", contacts.precision), ("recall", contacts.recall))
        words = "".join(f"; {name} {part:.2f}" for name, part in parts if part is not None)
        yield "foot contacts", f"{contacts.f1:>6.2f}          F1 against the source{words}"
    if drift is not None:
        yield (
            "root drift",
            f"{drift.distance.max():>6.2f} m        at most; {drift.distance[-1]:.2f} m at the end "
            f"of a path of {drift.path_length:.1f} m; heading "
            f"{np.degrees(np.abs(drift.heading).max()):.0f}° at most",
        )
    if report.truth is not None:
        truth = report.truth
        yield (
            "ground truth",
            f"{truth.mpjpe:>6.2f} %        of the height away in the mean; MSE {truth.mse:.2g}, "
            f"root-relative {truth.relative_mse:.2g}",
        )
    for name, unit, kind, value in (
        ("joint speed", "rad/s", "at most", lambda clip: float(clip.joint_speed.max(initial=0.0))),
        ("joint jerk", "rad/s³", "RMS", lambda clip: clip.jerk_rms),
    ):
        beside = "" if source is None else f"; source {value(source):.0f}"
        yield name, f"{value(clip):>6.0f} {unit:<6}   {kind}{beside}"
