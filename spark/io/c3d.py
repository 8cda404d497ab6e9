"""C3D and TRC files as recordings: joint centres by their labels, or markers of known sets.

What is there are points: rotations are fitted to them, as to any positions.
"""

from pathlib import Path

import numpy as np

from spark.errors import FileFormatError, name_list
from spark.io.c3d_file import C3dPoints, read_c3d_points
from spark.io.marker_sets import Points, centres, centres_of_markers, layout_of, plain
from spark.io.position_files import filled
from spark.io.positions import on_layout, recording_of
from spark.io.recording import Recording
from spark.io.trc_file import read_trc_points
from spark.runs import true_runs
from spark.summary import counted

_UNITS = {"mm": 0.001, "cm": 0.01, "m": 1.0, "dm": 0.1, "in": 0.0254, "inch": 0.0254}
_UNITS |= {"millimeters": 0.001, "meters": 1.0, "metres": 1.0}


def read_c3d(
    path: str | Path,
    *,
    unit: str | float | None = None,
    up: str | None = None,
    fps: float | None = None,
) -> Recording:
    """The recording in a C3D file of joint centres, or of Plug-in Gait's or CMU's markers.

    Unit and rate are the file's where not given; the up axis is the one along which the body
    stands. Raises `FileFormatError` where the points are neither, or the file is broken.
    """
    path = Path(path)
    return _of_points(path, read_c3d_points(path), unit, up, fps)


def read_trc(
    path: str | Path,
    *,
    unit: str | float | None = None,
    up: str | None = None,
    fps: float | None = None,
) -> Recording:
    """The recording in a TRC file, as `read_c3d` reads one of a C3D."""
    path = Path(path)
    return _of_points(path, read_trc_points(path), unit, up, fps)


def _of_points(
    path: Path,
    points: C3dPoints,
    unit: str | float | None,
    up: str | None,
    fps: float | None,
) -> Recording:
    labelled: Points = {}
    for label, values in zip(points.labels, points.values.swapaxes(0, 1), strict=True):
        if (name := plain(label)) and np.isfinite(values).any():
            labelled.setdefault(name, values)
    unit_m = _UNITS.get((points.unit or "mm").lower().strip(), 0.001)
    notes = list(points.notes)
    joints = centres(labelled)
    if joints:
        notes.insert(0, f"{len(joints)} joint centres of the file's {len(points.labels)} points")
    else:
        joints = centres_of_markers(labelled, unit_m)
        notes.insert(
            0,
            f"{len(joints)} joint centres estimated from markers on the skin (hips by Harrington, "
            "elbows at their markers): 1 to 4 cm off",
        )
    if not joints:
        raise FileFormatError(
            path,
            None,
            f"holds {len(points.labels)} points ({name_list([x for x in points.labels if x])}); "
            "expected joint centres of hips, knees and ankles (LHJC, LKJC, LAJC, or LeftHip, ...), "
            "or the markers of Plug-in Gait; else export BVH or FBX from the program that solved "
            "them",
        )
    layout = layout_of(joints, points.rate or 100.0)
    values = np.stack([joints[name] for name in layout.points], axis=1)
    rate = fps or points.rate
    values, gaps = filled(values, path)
    if gaps:
        notes.append(_told_gaps(np.stack(list(joints.values()), axis=1), gaps, rate))
    if unit is None:
        said = "as the file says" if points.unit else "as is usual"
        notes.append(f"unit {100 * unit_m:g} cm, {said}")
    return recording_of(
        on_layout(values, layout),
        layout,
        notes,
        path,
        unit=unit_m if unit is None else unit,
        up=up,
        rate=rate,
    )


def _told_gaps(values: np.ndarray, gaps: int, rate: float | None) -> str:
    missing = ~np.isfinite(values).all(axis=-1)
    gaps_of = [stop - start for column in missing.T for start, stop in true_runs(column)]
    longest = max(gaps_of, default=0)
    span = counted(longest, "frame") if rate is None else f"{longest / rate:.2g} s"
    return f"{gaps} positions are missing, {span} at the longest: filled in between neighbours"
