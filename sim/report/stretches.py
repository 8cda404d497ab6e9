"""Long clips measured a stretch at a time: what poses and forces take in between is the same for an
hour as for a minute, and each measure comes out as of the whole."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from sim.report.clip_metrics import ClipMetrics
from sim.report.clip_poses import pose_clip
from sim.report.derivatives import SPLINE
from sim.report.measuring import measure
from sim.report.thresholds import PLAUSIBILITY
from sim.trajectory import Subject
from spark.blocks import blocks
from spark.transfer.ground import Ground

_PRECISION = np.float32  # of what is kept of each frame: seven digits, half of an hour's memory
_ROWS = (
    *("depth", "clearance", "corner_skates", "corner_speeds", "sole_heights", "sole_speeds"),
    *("base_acceleration", "limb_acceleration", "unexplained_wrench", "imbalance"),
    *("joint_speed", "joint_jerk", "joint_turns"),
)

Name = tuple[Any, ...]
Rows = dict[Name, np.ndarray]


def measure_clip(subject: Subject, ground: Ground) -> ClipMetrics:
    """The measures of a motion over some ground. Raises what `pose_clip` raises."""
    count = len(subject.motion)
    stretches = [*blocks(count)]
    if len(stretches) == 1:
        return measure(pose_clip(subject), ground)
    margin = _margin(subject.motion.frame_time)
    rows: Rows = {}
    for block in stretches:
        near = slice(max(block.start - margin, 0), min(block.stop + margin, count))
        clip = measure(pose_clip(subject.picked(near)), ground.picked(near))
        own = slice(block.start - near.start, block.stop - near.start)
        for name, values in _rows_of(clip):
            if name not in rows:  # pages of zeros take no memory until something is written
                kept = _PRECISION if values.dtype == np.float64 else values.dtype
                rows[name] = np.zeros((count, *values.shape[1:]), kept)
            rows[name][block] = values[own]
    return replace(_with_rows(clip, rows), ground=ground)


def _margin(frame_time: float) -> int:
    """How many frames beside a stretch its measures depend on: those of the second derivative of a
    first one, and of the least of a first one over `static_time`."""
    limits = PLAUSIBILITY
    seconds = max(2 * limits.window, limits.window + limits.static_time)
    return int(np.ceil(seconds / frame_time)) + 2 * SPLINE


def _rows_of(clip: ClipMetrics) -> Iterator[tuple[Name, np.ndarray]]:
    """All that has a row for each frame, by name."""
    yield from (((name,), getattr(clip, name)) for name in _ROWS)
    yield from ((("flags", name), flag) for name, flag in clip.flags.items())
    yield from ((("standing", foot), stands) for foot, stands in clip.standing.items())
    yield from ((("limits", k), each.beyond) for k, each in enumerate(clip.limits))
    yield from ((("torques", k), each.torque) for k, each in enumerate(clip.torques))
    yield from (
        (("self_pairs", pair), depth)
        for pair, depth in zip(clip.self_pairs, clip.self_depth.T, strict=True)
    )


def _with_rows(clip: ClipMetrics, rows: Rows) -> ClipMetrics:
    """The measures of one stretch with the rows of all; pairs of parts that no frame of the others
    shows are added."""
    of: dict[str, Any] = {name: rows[name,] for name in _ROWS}
    pairs = tuple(key[1] for key in rows if key[0] == "self_pairs")
    depth = [rows["self_pairs", pair] for pair in pairs]
    return replace(
        clip,
        **of,
        flags={name: rows["flags", name] for name in clip.flags},
        standing={foot: rows["standing", foot] for foot in clip.standing},
        limits=tuple(replace(each, beyond=rows["limits", k]) for k, each in enumerate(clip.limits)),
        torques=tuple(
            replace(each, torque=rows["torques", k]) for k, each in enumerate(clip.torques)
        ),
        self_pairs=pairs,
        self_depth=np.stack(depth, axis=1) if depth else np.zeros((len(of["clearance"]), 0)),
    )
