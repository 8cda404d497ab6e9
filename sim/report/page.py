"""The report as one self-contained web page: headline, replay, worst moments, plots."""

import base64
import io
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8
from markupsafe import Markup

from sim.report.clip_metrics import ClipMetrics
from sim.report.clip_poses import pose_clip
from sim.report.names import FLAGS, LABELS
from sim.report.palette import CORNER_COLORS, css, grade
from sim.report.plots import flag_strips, plots, svg
from sim.report.record import record
from sim.report.result import Finding, Result
from sim.report.table import shares
from sim.report.text import details, share_base
from sim.template import render_page
from sim.trajectory import Subject
from sim.view.page import Overlay, page
from sim.view.render import frames
from sim.view.scene import Figure, build_scene
from spark.errors import DependencyError
from spark.files import write_atomically

_MOMENTS = 6  # pictures
_LISTED = 200  # findings
_STANDS, _SLIDES, _SINKS = range(1, 4)  # states of a corner, in the order of `CORNER_COLORS`


def write_report_page(
    result: Result,
    path: str | Path,
    subject: Subject,
    source: Subject | None = None,
    *,
    title: str,
    names: tuple[str, str] = ("motion", "source"),
) -> None:
    """Write the page of `result`, which `assess` made of `subject` and `source`, to `path`."""
    text = report_page(result, subject, source, title=title, names=names)
    write_atomically(Path(path), text.encode())


def report_page(
    result: Result,
    subject: Subject,
    source: Subject | None = None,
    *,
    title: str,
    names: tuple[str, str] = ("motion", "source"),
) -> str:
    """The page as text; it opens offline. Where nothing can be drawn off screen its pictures are
    left out, and it says so."""
    shown = [(subject, result.clip, names[0])]
    if source is not None and result.source is not None:
        shown.append((source, result.source, names[1]))
    figures = [Figure(each, name, metrics.floor_z) for each, metrics, name in shown]
    overlays = [_overlay(metrics, each) for each, metrics, _ in shown]
    clip, frame_time = result.clip, result.clip.frame_time
    duration = (len(clip) - 1) * frame_time
    source_duration = (subject if source is None else source).motion.duration
    moments, note = _moments(result, figures)
    beside = ""
    if result.source is not None:
        beside = f"; of the source's {100 * result.source.implausible_share:.1f} %"
    return render_page(
        "sim.report",
        framed=("sim.view",),
        title=title,
        palette=Markup(css()),
        grade=grade(100 * result.implausible),
        headline=f"{100 * result.implausible:.1f} % of the frames are implausible",
        about=f"{len(clip)} frames, {duration:.1f} s{beside}",
        cards=_cards(result),
        key=CORNER_COLORS,
        replay=page(figures, title="", overlays=overlays),
        findings=[_line(f, f.start, clip) for f in result.findings[:_LISTED]],
        unlisted=max(len(result.findings) - _LISTED, 0),
        moments=moments,
        strips=flag_strips(clip),
        plots=Markup().join(svg(plot, duration, source_duration) for plot in plots(result)),
        notes=(*result.notes, *note, clip.thresholds.version),
        duration=duration,
        record=record(result),
    )


def _overlay(clip: ClipMetrics, subject: Subject) -> Overlay:
    """The soles' corners as dots, and the labels of each frame's flags."""
    poses = pose_clip(subject)
    heights = poses.corners[..., 2] - clip.floor_z
    states = np.zeros(heights.shape, dtype=np.uint8)
    states[heights < clip.thresholds.skate_height] = _STANDS
    states[clip.corner_skates] = _SLIDES
    states[heights < -clip.thresholds.penetration] = _SINKS
    labels = tuple(
        tuple(LABELS[name] for name in FLAGS if clip.flags[name][t]) for t in range(len(clip))
    )
    return Overlay(poses.corners, states, labels, tuple(CORNER_COLORS.values()))


def _cards(result: Result) -> list[dict[str, Any]]:
    """A card for each measure."""
    theirs = {} if result.source is None else shares(result.source)
    cards: list[dict[str, Any]] = []
    for measure, percent in shares(result.clip).items():
        if percent is None:
            continue
        small = [] if (their := theirs.get(measure)) is None else [f"source {their:.1f} %"]
        if base := share_base(result.clip, measure):
            small.append(base)
        value = f"{percent:.1f} %"
        cards.append(
            {"label": LABELS[measure], "value": value, "lines": small, "grade": grade(percent)}
        )
    for label, words in details(result):
        value, _, rest = words.strip().partition("  ")
        cards.append({"label": label, "value": value, "lines": [rest.strip()], "grade": ""})
    return cards


def _line(finding: Finding, frame: int, clip: ClipMetrics) -> dict[str, Any]:
    """A finding in words, and the time [s] that a click on it goes to."""
    return {
        "time": f"{frame * clip.frame_time:.3f}",
        "sentence": finding.sentence,
        "place": finding.place(clip.frame_time),
    }


def _moments(result: Result, figures: list[Figure]) -> tuple[list[dict[str, Any]], tuple[str, ...]]:
    """Pictures of the gravest finding of each measure, and a note where they can't be made."""
    gravest = {finding.measure: finding for finding in reversed(result.findings)}
    picked = list(gravest.values())[::-1][:_MOMENTS]
    if not picked:
        return [], ()
    scene = build_scene(figures)
    frame_time = result.clip.frame_time
    at = [
        min(round(_middle(f) * frame_time / scene.frame_time), len(scene.qpos) - 1) for f in picked
    ]
    try:
        pictures = [_jpeg(p) for p in frames(scene, at, width=640, height=540)]
    except DependencyError as error:
        return [], (f"no pictures: {error}",)
    return [
        {**_line(finding, _middle(finding), result.clip), "picture": picture}
        for finding, picture in zip(picked, pictures, strict=True)
    ], ()


def _middle(finding: Finding) -> int:
    return (finding.start + finding.stop - 1) // 2


def _jpeg(picture: UInt8[np.ndarray, "H W 3"]) -> str:
    """Without an eighth above and below: the camera leaves room for arms overhead."""
    try:
        from PIL import Image
    except ImportError as error:
        raise DependencyError("pictures need Pillow: pip install 'spark-sim[video]'") from error
    buffer = io.BytesIO()
    height = len(picture)
    Image.fromarray(picture[height // 8 : -height // 8]).save(buffer, format="JPEG", quality=85)
    return base64.b64encode(buffer.getvalue()).decode()
