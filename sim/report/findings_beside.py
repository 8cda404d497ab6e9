"""What is wrong beside the source: findings of one measure each."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sim.report.clip_metrics import ClipMetrics
from sim.report.contact_timing import Discord
from sim.report.hovers import Hover
from sim.report.limbs import Limbs
from sim.report.measures import Drift
from sim.report.pose_error import Part, PoseError
from sim.report.result import Finding
from sim.report.slides import Slide
from sim.report.swing import Swing
from spark.constants import GRAVITY
from spark.runs import true_runs

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


@dataclass(frozen=True, eq=False)
class Beside:
    """How a motion differs from its source."""

    drift: Drift
    swing: Swing | None
    limbs: Limbs | None
    pose: PoseError | None
    discord: Discord | None
    slides: tuple[Slide, ...]
    hovers: tuple[Hover, ...]
    thrown: float  # [m/s²] the 99th percentile of the source's base acceleration, scaled
    hover: float  # [m] the height that the source's lowest point keeps, scaled


def contact_findings(discord: Discord) -> Iterator[Finding]:
    """Feet that stand at other times."""
    match = discord.match
    missed = (match.recall or 0.0) < (match.precision or 0.0)
    measure = "missed_contact" if missed else "invented_contact"
    f1 = match.f1 or 0.0
    yield Finding(measure, "feet", discord.start, discord.stop, f1, "f1", discord.words)


def slide_findings(slides: tuple[Slide, ...]) -> list[Finding]:
    """Feet that slide where the source's stand, the furthest first."""
    return [
        Finding(
            "skating",
            foot,
            start,
            stop,
            distance,
            "m",
            f"{foot} slides {100 * distance:.1f} cm where the source's stands",
        )
        for foot, start, stop, distance in sorted(slides, key=lambda slide: -slide.distance)
    ]


def swing_findings(swing: Swing) -> Iterator[Finding]:
    """Feet that pass too low or too high."""
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


def base_findings(clip: ClipMetrics, thrown: float) -> Iterator[Finding]:
    """A base that is thrown harder than the source's 99th percentile, scaled (`thrown` [m/s²])."""
    found = clip.base_acceleration_p99
    # In a source that hardly moves, half of gravity is nothing to be thrown by.
    if found <= max(_MAX_THROW * thrown, 0.5 * GRAVITY):
        return
    worst = int(clip.base_acceleration.argmax())
    amount = float(clip.base_acceleration[worst])
    sentence = f"the base is thrown by {amount:.0f} m/s², the source's by {thrown:.0f}"
    yield Finding("base_acceleration", "root", worst, worst + 1, amount, "m_s2", sentence)


def limb_findings(clip: ClipMetrics, limbs: Limbs, gap: int) -> list[Finding]:
    """Limbs that are thrown, the hardest first."""
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


def pose_findings(pose: PoseError, frame_time: float, gap: int) -> list[Finding]:
    """Parts that point elsewhere, the furthest first."""
    findings = []
    for part, angles, far in zip(pose.parts, pose.angles.T, pose.far.T, strict=True):
        for start, stop in true_runs(far, gap):
            if (stop - start) * frame_time < _LASTS:
                continue
            amount = float(angles[start:stop].max())
            sentence = _away(part, amount)
            findings.append(Finding("pose", part.name, start, stop, amount, "rad", sentence))
    named = {finding.where for finding in findings}
    for part, mean in zip(pose.parts, pose.means, strict=True):
        if part.kind != "foot" and part.name not in named and mean > _ELSEWHERE:
            sentence = f"{_away(part, mean)} in the mean"
            count = len(pose.angles)
            findings.append(Finding("pose", part.name, 0, count, float(mean), "rad", sentence))
    return sorted(findings, key=lambda found: -found.amount)


def _away(part: Part, angle: float) -> str:
    turned = "is turned" if part.kind == "hand" else "points"
    return f"{part.name} {turned} {np.degrees(angle):.0f}° away from the source's"


def drift_findings(drift: Drift) -> Iterator[Finding]:
    """A root that strays, and a heading."""
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
