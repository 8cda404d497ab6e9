"""Several results of one motion beside each other: tools, settings, versions."""

from collections.abc import Mapping

from sim.report.clip_metrics import FLAGS
from sim.report.result import Report

_BEST, _LABEL = 32, 34  # green; the first column's width
_DIGITS = {"1e-4": 2, "% of height": 2}  # others are told with one


def figures(report: Report) -> dict[str, tuple[str, float | None]]:
    """Each measure's unit and value; None where the clip has nothing to measure it on."""
    clip, drift, contacts, truth = report.clip, report.drift, report.contacts, report.truth
    rows: dict[str, tuple[str, float | None]] = {"implausible": ("%", 100 * report.implausible)}
    rows |= {name: ("%", 100 * clip.shares[letter]) for letter, name in FLAGS.items()}
    balance = clip.unbalanced_share
    return rows | {
        "joint limits": ("%", 100 * clip.limit_share),
        "at a limit": ("%", 100 * clip.at_limit_share),
        "self-penetration": ("%", 100 * float(clip.self_penetration.mean())),
        "out of balance": ("%", None if balance is None else 100 * balance),
        "contacts missed": (
            "%",
            None if contacts is None or contacts.recall is None else 100 * (1 - contacts.recall),
        ),
        "contacts invented": (
            "%",
            None
            if contacts is None or contacts.precision is None
            else 100 * (1 - contacts.precision),
        ),
        "root drift": ("cm", None if drift is None else 100 * float(drift.distance.max())),
        "joint speed": ("rad/s", float(clip.joint_speed.max(initial=0.0))),
        "joint jerk": ("rad/s³", clip.jerk_rms),
        "ground-truth MSE": ("1e-4", None if truth is None else 1e4 * truth.mse),
        "ground-truth MPJPE": ("% of height", None if truth is None else truth.mpjpe),
    }


def compare(reports: Mapping[str, Report], *, color: bool = False) -> str:
    """A table with a row for each measure and a column for each report; less is better in all.

    The least of each row is marked with a star, or coloured, where the reports differ.
    """
    columns = {name: figures(report) for name, report in reports.items()}
    names = list(columns)
    measures = list(next(iter(columns.values())))
    width = max(9, *(len(name) + 2 for name in names))
    lines = ["".join([f"{'':<{_LABEL}}", *(f"{name:>{width}}" for name in names)])]
    for measure in measures:
        unit = columns[names[0]][measure][0]
        values = [columns[name][measure][1] for name in names]
        known = [value for value in values if value is not None]
        if not known:
            continue
        digits = _DIGITS.get(unit, 1)
        shown = ["-" if value is None else f"{value:.{digits}f}" for value in values]
        best = f"{min(known):.{digits}f}" if len({*shown} - {"-"}) > 1 else None
        cells = [_cell(text, text == best, width, color) for text in shown]
        lines.append("".join([f"{f'{measure} [{unit}]':<{_LABEL}}", *cells]))
    return "\n".join(line.rstrip() for line in lines)


def _cell(text: str, best: bool, width: int, color: bool) -> str:
    if color:
        return f"\x1b[{_BEST}m{text:>{width}}\x1b[0m" if best else f"{text:>{width}}"
    return f"{text + ('*' if best else ' '):>{width}}"
