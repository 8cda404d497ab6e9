"""The report as one self-contained web page: headline, replay, worst moments, plots."""

import base64
import html
import io
import json
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from sim.report.assess import Source
from sim.report.clip_metrics import FLAGS, ClipMetrics
from sim.report.clip_poses import pose_clip
from sim.report.plots import flag_strips, plots, svg
from sim.report.result import Finding, Report
from sim.report.text import figures, of_which, shares
from sim.trajectory import ModelTrajectory
from sim.view.page import Marks, page
from sim.view.render import frames
from sim.view.scene import Figure, build_scene
from spark.errors import DependencyError, OutputError
from spark.motion import Motion
from spark.rig.rig import Rig

_MOMENTS = 6
_LISTED = 200
_STANDS, _SLIDES, _SINKS = 1, 2, 3


def write_report_page(
    report: Report,
    path: str | Path,
    motion: Source,
    source: Source | None = None,
    *,
    title: str,
    names: tuple[str, str] = ("motion", "source"),
) -> None:
    """Write the page of `report`, which `assess` made of `motion` and `source`, to `path`."""
    text = report_page(report, motion, source, title=title, names=names)
    try:
        Path(path).write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{path}: can't be written ({error.strerror or error})") from error


def report_page(
    report: Report,
    motion: Source,
    source: Source | None = None,
    *,
    title: str,
    names: tuple[str, str] = ("motion", "source"),
) -> str:
    """The page as text; it opens offline. Where nothing can be drawn off screen its pictures are
    left out, and it says so."""
    shown = [(motion, report.clip, names[0])]
    if source is not None and report.source is not None:
        shown.append((source, report.source, names[1]))
    bodies = [
        Figure(rig, clip, name, measured.floor_z, body[0] if body else None)
        for (clip, rig, *body), measured, name in shown
    ]
    marks = [_marks(measured, *judged) for judged, measured, _ in shown]
    clip, frame_time = report.clip, report.clip.frame_time
    duration = (len(clip) - 1) * frame_time
    source_duration = motion[0].duration if source is None else source[0].duration
    moments, note = _moments(report, bodies)
    beside = ""
    if report.source is not None:
        beside = f"; of the source's {100 * report.source.implausible_share:.1f} %"
    fields = {
        "TITLE": html.escape(title),
        "GRADE": _grade(report.implausible),
        "HEADLINE": f"{100 * report.implausible:.1f} % of the frames are implausible",
        "ABOUT": f"{len(clip)} frames, {duration:.1f} s{beside}",
        "CARDS": _cards(report),
        "REPLAY": html.escape(page(bodies, title="", marks=marks)),
        "FINDINGS": _list(report),
        "MOMENTS": moments,
        "STRIPS": flag_strips(clip),
        "PLOTS": "".join(svg(plot, duration, source_duration) for plot in plots(report)),
        "NOTES": "<br>".join(
            html.escape(line) for line in (*report.notes, *note, clip.thresholds.version)
        ),
        "DURATION": repr(duration),
        "RECORD": json.dumps(report.json(), allow_nan=False).replace("</", "<\\/"),
    }
    text = (Path(__file__).with_name("page.html")).read_text(encoding="utf-8")
    head, *rest = text.split("__")
    # Every second piece is a field's name: no field's text is looked through for others.
    return head + "".join(
        fields[name] + piece for name, piece in zip(rest[::2], rest[1::2], strict=True)
    )


def _marks(
    measured: ClipMetrics, motion: Motion, rig: Rig, body: ModelTrajectory | None = None
) -> Marks:
    poses = pose_clip(motion, rig, body)
    heights = poses.points[..., 2] - measured.floor_z
    states = np.zeros(heights.shape, dtype=np.uint8)
    states[heights < measured.thresholds.skate_height] = _STANDS
    states[measured.skating] = _SLIDES
    states[heights < -measured.thresholds.penetration] = _SINKS
    letters = [
        [letter for letter in FLAGS if measured.flags[letter][t]] for t in range(len(measured))
    ]
    return Marks(poses.points, states, tuple(" ".join(each) for each in letters))


def _cards(report: Report) -> str:
    theirs = {} if report.source is None else dict(shares(report.source))
    cards = [
        f'<div class="card"><small>{html.escape(name)}</small>'
        f'<b class="{_grade(share)}">{100 * share:.1f} %</b>'
        + (f"<small>source {100 * theirs[name]:.1f} %</small>" if name in theirs else "")
        + (f"<small>{rest}</small>" if (rest := of_which(report.clip, name)) else "")
        + "</div>"
        for name, share in shares(report.clip)
    ]
    for name, words in figures(report):
        value, _, rest = words.strip().partition("  ")
        cards.append(
            f'<div class="card"><small>{html.escape(name)}</small><b>{html.escape(value)}</b>'
            f"<small>{html.escape(rest.strip())}</small></div>"
        )
    return "".join(cards)


def _list(report: Report) -> str:
    frame_time = report.clip.frame_time
    rows = [
        f'<li><button data-time="{finding.start * frame_time:.3f}">'
        f"{html.escape(finding.sentence)} <small>{finding.place(frame_time)}</small></button></li>"
        for finding in report.findings[:_LISTED]
    ]
    if len(report.findings) > _LISTED:
        rows.append(f"<li><button>... and {len(report.findings) - _LISTED} more</button></li>")
    return "".join(rows) or "<li><button>nothing to mend</button></li>"


def _moments(report: Report, bodies: list[Figure]) -> tuple[str, tuple[str, ...]]:
    """Pictures of the gravest finding of each measure, and a note where they can't be made."""
    gravest = {finding.measure: finding for finding in reversed(report.findings)}
    picked = list(gravest.values())[::-1][:_MOMENTS]
    if not picked:
        return "", ()
    scene = build_scene(bodies)
    frame_time = report.clip.frame_time
    at = [
        min(round(_middle(f) * frame_time / scene.frame_time), len(scene.qpos) - 1) for f in picked
    ]
    try:
        pictures = [_jpeg(p) for p in frames(scene, at, width=640, height=540)]
    except DependencyError as error:
        return "", (f"no pictures: {error}",)
    tiles = "".join(
        f'<button data-time="{_middle(f) * frame_time:.3f}"><img alt="" '
        f'src="data:image/jpeg;base64,{picture}"><span>{html.escape(f.sentence)} '
        f"<small>{f.place(frame_time)}</small></span></button>"
        for f, picture in zip(picked, pictures, strict=True)
    )
    return f'<h2>Worst moments</h2><div class="moments">{tiles}</div>', ()


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


def _grade(share: float) -> str:
    return "good" if share <= 0.01 else "fair" if share <= 0.05 else "bad"
