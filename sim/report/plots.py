"""A report's measures over time, as inline SVG: no script, no library, any zoom."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from markupsafe import Markup

from sim.report.clip_metrics import ClipMetrics
from sim.report.names import FLAGS, LABELS
from sim.report.pose_error import FAR
from sim.report.result import Result
from spark.runs import true_runs

WIDTH, _HEIGHT, _STRIP = 1000.0, 88, 14
_POINTS = 500  # of a line: more can't be seen


@dataclass(frozen=True, eq=False)
class Plot:
    """One measure: what it is called, its unit, its values, which frames are flagged, where it
    is too much, the source's values at times of their own, and the least range that is drawn."""

    name: str
    unit: str
    values: Float[np.ndarray, "T"]
    flagged: Bool[np.ndarray, "T"]
    limit: float | None
    source: Float[np.ndarray, "S"] | None = None
    worst_is_low: bool = False  # of many points in one pixel, show the least
    min_range: float = 1.0


def plots(result: Result) -> list[Plot]:
    """What is worth a look over time."""
    clip, source, limits = result.clip, result.source, result.clip.thresholds
    tremble, trembles = result.tremble, result.tremble.source_points
    flags, never = clip.flags, np.zeros(len(clip), dtype=bool)

    def beside(
        measure: Callable[[ClipMetrics], Float[np.ndarray, "S"]],
    ) -> Float[np.ndarray, "S"] | None:
        return None if source is None else measure(source)

    shown = [
        Plot(
            "lowest point above the floor",
            "cm",
            100 * _lowest_point(clip),
            flags["penetration"] | flags["floating"],
            -100 * limits.penetration,
            beside(lambda each: 100 * _lowest_point(each)),
            worst_is_low=True,
        ),
        Plot(
            "sliding foot",
            "m/s",
            _skate_speed(clip),
            flags["skating"],
            None,
            beside(_skate_speed),
            min_range=limits.skate_speed,
        ),
        Plot(
            "force that nothing gives",
            "body weights",
            clip.unexplained_wrench[:, 0],
            flags["root_wrench"],
            limits.wrench_force,
            beside(lambda each: each.unexplained_wrench[:, 0]),
        ),
        Plot(
            "joints beyond their limits",
            "°",
            _limit_excess(clip),
            _limit_excess(clip) > 0,
            None,
            beside(_limit_excess),
        ),
        Plot(
            "body parts in each other",
            "cm",
            100 * clip.self_depth.max(axis=1, initial=0.0),
            clip.self_penetration,
            100 * clip.self_bound,
        ),
        Plot(
            "acceleration of the base",
            "m/s²",
            clip.base_acceleration,
            never,
            None,
            beside(lambda each: result.scale * each.base_acceleration),
        ),
        *_limbs(result),
        Plot("fastest joint", "rad/s", _fastest(clip), never, None, beside(_fastest)),
        Plot(
            "tremble",
            "mm",
            1000 * tremble.points.max(axis=1),
            np.any(tremble.points_far, axis=1),
            None,
            None if trembles is None else 1000 * trembles.max(axis=1),
        ),
    ]
    if clip.torques:
        load = np.max([each.load for each in clip.torques], axis=0)
        name, most = "highest torque", limits.torque
        shown.append(Plot(name, "of the motor's", load, load > most, most))
    if result.pose is not None:
        away = np.degrees(result.pose.angles).max(axis=1)
        far = np.any(result.pose.far, axis=1)
        shown.append(
            Plot("farthest part off the source's pose", "°", away, far, float(np.degrees(FAR)))
        )
    if result.drift is not None:
        shown.append(Plot("root drift", "cm", 100 * result.drift.distance, never, None))
    if result.truth is not None:
        shown.append(
            Plot("distance from the truth", "% of height", result.truth.errors, never, None)
        )
    return shown


def _limbs(result: Result) -> list[Plot]:
    """Of all limbs that both have, the hardest throw."""
    clip, source, limbs = result.clip, result.source, result.limbs
    names = clip.limb_names if limbs is None else limbs.names
    if not names:
        return []

    def hardest(side: ClipMetrics, scales: Float[np.ndarray, "L"] | float) -> Any:
        columns = [side.limb_names.index(name) for name in names]
        return (scales * side.limb_acceleration[:, columns]).max(axis=1)

    thrown = np.zeros(len(clip), dtype=bool) if limbs is None else np.any(limbs.thrown, axis=1)
    beside = None if source is None or limbs is None else hardest(source, limbs.scales)
    return [Plot("acceleration of the limbs", "m/s²", hardest(clip, 1.0), thrown, None, beside)]


def svg(plot: Plot, duration: float, source_duration: float) -> Markup:
    """One plot, `duration` [s] wide: flagged frames shaded, the source behind, the limit dashed."""
    series = [plot.values] + ([] if plot.source is None else [plot.source])
    top = max(1.2 * max(_peak(v) for v in series), plot.limit or 0.0, plot.min_range)
    bottom = min(0.0, 1.2 * min(float(v.min()) for v in series), 1.5 * (plot.limit or 0.0))

    def y(value: Float[np.ndarray, "N"] | float) -> Float[np.ndarray, "N"]:
        inside = np.clip(np.atleast_1d(value), bottom, top)
        return (1 - (inside - bottom) / (top - bottom)) * (_HEIGHT - 4) + 2

    parts = [_shades(plot.flagged, _HEIGHT)]
    across = Markup('<path class="{}" d="M0 {:.1f}H{:g}"/>')
    parts.append(across.format("zero", y(0.0)[0], WIDTH))
    if plot.limit is not None:
        parts.append(across.format("limit", y(plot.limit)[0], WIDTH))
    if plot.source is not None:
        width = WIDTH * (source_duration / duration if duration else 1.0)
        parts.append(_line(y(plot.source), width, plot.worst_is_low, "source"))
    parts.append(_line(y(plot.values), WIDTH, plot.worst_is_low, "clip"))
    return Markup(
        "<figure><figcaption>{} <small>[{}], {:.3g} to {:.3g}</small></figcaption>"
        '<svg role="img" aria-label="{}" viewBox="0 0 {:g} {}" preserveAspectRatio="none">{}</svg>'
        "</figure>"
    ).format(plot.name, plot.unit, bottom, top, _words(plot), WIDTH, _HEIGHT, Markup().join(parts))


def _words(plot: Plot) -> str:
    """What the plot shows, for those who don't see it."""
    low, high = float(plot.values.min()), float(plot.values.max())
    flagged = f"; flagged in {100 * plot.flagged.mean():.1f} % of the frames"
    return (
        f"{plot.name} over time: from {low:.3g} to {high:.3g} {plot.unit}"
        f"{flagged if plot.flagged.any() else ''}"
    )


def _peak(values: Float[np.ndarray, "N"]) -> float:
    """The 99.5th percentile of what is above zero: one spike must not flatten the rest."""
    return float(np.percentile(values[values > 0], 99.5)) if np.any(values > 0) else 0.0


def flag_strips(clip: ClipMetrics) -> Markup:
    """When each flag is up: one strip a flag."""
    strip = Markup(
        "<figure class=strip><figcaption>{}</figcaption>"
        '<svg role="img" aria-label="{}" viewBox="0 0 {:g} {}" preserveAspectRatio="none">{}</svg>'
        "</figure>"
    )
    words = "{}: {:.1f} % of the frames"
    return Markup().join(
        strip.format(
            LABELS[name],
            words.format(LABELS[name], 100 * clip.shares[name]),
            WIDTH,
            _STRIP,
            _shades(clip.flags[name], _STRIP),
        )
        for name in FLAGS
    )


def _shades(flags: Bool[np.ndarray, "T"], height: int) -> Markup:
    step = WIDTH / max(len(flags), 1)
    rect = Markup('<rect x="{:.1f}" width="{:.1f}" y="0" height="{}"/>')
    return Markup().join(
        rect.format(start * step, max((stop - start) * step, 1.5), height)
        for start, stop in true_runs(flags)
    )


def _line(y: Float[np.ndarray, "T"], width: float, worst_is_low: bool, kind: str) -> Markup:
    """A path of at most `_POINTS` points; the worst of the frames that fall on one is shown."""
    size = max(1, -(-len(y) // _POINTS))
    padded = np.pad(y, (0, -len(y) % size), mode="edge").reshape(-1, size)
    worst = padded.max(axis=1) if worst_is_low else padded.min(axis=1)  # y points down
    x = np.linspace(0, width, len(worst))
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, worst, strict=True))
    return Markup('<polyline class="{}" points="{}"/>').format(kind, points)


def _lowest_point(clip: ClipMetrics) -> Float[np.ndarray, "T"]:
    return np.where(clip.depth.max(axis=1) > 0, -clip.depth.max(axis=1), clip.clearance)


def _skate_speed(clip: ClipMetrics) -> Float[np.ndarray, "T"]:
    return np.where(clip.corner_skates, clip.corner_speeds, 0.0).max(axis=1)


def _fastest(clip: ClipMetrics) -> Float[np.ndarray, "T"]:
    return clip.joint_pace.max(axis=1, initial=0.0)


def _limit_excess(clip: ClipMetrics) -> Float[np.ndarray, "T"]:
    if not clip.limits:
        return np.zeros(len(clip))
    return np.degrees(np.max([limit.excess.max(axis=1) for limit in clip.limits], axis=0))
