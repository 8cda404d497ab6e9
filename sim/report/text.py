"""The report as text."""

import numpy as np

from sim.report.result import FLAGS, Finding, Report

_RED, _YELLOW, _GREEN, _DIM, _BOLD = 31, 33, 32, 2, 1
_SHOWN = 3  # of the findings of one measure


def render(report: Report, *, color: bool) -> str:
    """Headline, parts, what to mend, and what was assumed."""

    def paint(text: str, *codes: int) -> str:
        return f"\x1b[{';'.join(map(str, codes))}m{text}\x1b[0m" if color else text

    def graded(share: float, text: str) -> str:
        return paint(text, _GREEN if share <= 0.01 else _YELLOW if share <= 0.05 else _RED)

    clip, source = report.clip, report.source
    frames = len(clip.clearance)
    headline = f"{_percent(report.implausible)} of the frames are implausible"
    lines = [
        paint(graded(report.implausible, headline), _BOLD)
        + f"  ({frames} frames, {(frames - 1) * clip.frame_time:.1f} s)"
    ]
    if source is not None:
        lines[0] += f"; of the source's {_percent(float(source.implausible.mean()))}"
    lines.append("")
    for letter, name in FLAGS.items():
        if letter not in clip.flags:
            continue
        share = clip.shares[letter]
        line = f"  {name:<14}{graded(share, f'{_percent(share):>8}')}"
        lines.append(line + ("" if source is None else _beside(source.shares[letter])))
    beyond = max(clip.limit_shares.values(), default=0.0)
    line = f"  {'joint limits':<14}{graded(beyond, f'{_percent(beyond):>8}')}"
    if source is not None:
        line += _beside(max(source.limit_shares.values(), default=0.0))
    lines.append(line + paint("  the worst joint", _DIM))
    if report.drift is not None:
        drift = report.drift
        lines.append(
            f"  {'root drift':<14}{drift.distance.max():>6.2f} m  at most, "
            f"{drift.distance[-1]:.2f} m at the end of a path of {drift.path_length:.1f} m; "
            f"heading {np.degrees(np.abs(drift.heading).max()):.0f}° at most"
        )
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


def _beside(source_share: float) -> str:
    return f"   source {_percent(source_share):>7}"
