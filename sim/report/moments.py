"""The worst moments of a motion as pictures: each figure in a frame of its own."""

from dataclasses import dataclass

import numpy as np

from sim.report.result import Finding, Result
from sim.view.figure import Figure
from sim.view.pictures import jpeg
from sim.view.render import stills
from sim.view.staging import build_scene
from spark.errors import DependencyError

_MOST = 6  # pictures
_APART = 0.25  # [s] findings nearer to each other than this share a picture
_SIZE = (360, 400)  # [pixels] of one figure
_GAP = 6  # [pixels] between figures
_QUALITY = 85  # of their JPEGs


@dataclass(frozen=True, eq=False)
class Moment:
    """A frame to look at, what is wrong in it, and a picture of it (JPEG, base64)."""

    frame: int
    findings: tuple[Finding, ...]
    picture: str


def worst_moments(result: Result, figures: list[Figure]) -> tuple[tuple[Moment, ...], str | None]:
    """Pictures of the gravest finding of each measure, and why there are none, where they can't be
    made."""
    gravest = {finding.measure: finding for finding in reversed(result.findings)}
    frame_time = result.clip.frame_time
    shown: dict[int, list[Finding]] = {}
    for finding in reversed(gravest.values()):
        middle = (finding.start + finding.stop - 1) // 2
        near = (f for f in shown if abs(f - middle) * frame_time < _APART)
        shown.setdefault(next(near, middle), []).append(finding)
    at = [*shown][:_MOST]
    if not at:
        return (), None
    try:
        pictures = _pictures(figures, [frame * frame_time for frame in at])
    except DependencyError as error:
        return (), f"no pictures: {error}"
    return tuple(
        Moment(frame, tuple(shown[frame]), picture)
        for frame, picture in zip(at, pictures, strict=True)
    ), None


def _pictures(figures: list[Figure], times: list[float]) -> list[str]:
    """All figures at some times [s], side by side; apart, so that none hides another."""
    width, height = _SIZE
    columns = []
    for figure in figures:
        scene = build_scene([figure])
        last = len(scene.qpos) - 1
        at = [min(round(time / scene.frame_time), last) for time in times]
        columns.append(stills(scene, at, width=width, height=height))
    gap = np.full((height, _GAP, 3), 255, dtype=np.uint8)
    return [
        jpeg(
            np.concatenate([part for column in row for part in (gap, column)][1:], axis=1),
            quality=_QUALITY,
        )
        for row in zip(*columns, strict=True)
    ]
