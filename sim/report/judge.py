"""Judge a motion: how plausible it is, and how it differs from the motion it was made from."""

import numpy as np

from sim.report.derivatives import derivative
from sim.report.findings import find
from sim.report.limits import limit_excess
from sim.report.measures import (
    Drift,
    at_times,
    floating,
    floor_height,
    penetration_depth,
    root_drift,
)
from sim.report.result import Measured, Report
from sim.report.support import support
from sim.report.thresholds import PLAUSIBILITY_V1
from sim.report.track import Track, track
from spark.errors import SkeletonError
from spark.motion import Motion
from spark.rig import Rig

# A source whose floor is further from z = 0 than this, in hip heights, may have been put on it.
_FLOOR_AT_ZERO = 0.1


def judge(motion: Motion, rig: Rig, *, source: tuple[Motion, Rig] | None = None) -> Report:
    """The plausibility report of `motion`, and its difference to `source` where that is given.

    The floor is the source's (the 5th percentile of its lowest sole point), scaled by the hip
    heights' ratio; without a source it is the motion's own, and a motion that floats or sinks as a
    whole can't be told. Raises SkeletonError for a body without feet and for a clip without frames.
    """
    if not len(motion):
        raise SkeletonError("the motion has no frames: nothing to judge")
    clip_track = track(motion, rig)
    if source is None:
        clip = _measure(clip_track, floor_height(clip_track.lowest_point))
        note = "the floor is the clip's own: one that floats or sinks as a whole can't be told"
        return Report(clip, None, None, find(clip, None), (note,))
    source_track = track(*source)
    source_floor = floor_height(source_track.lowest_point)
    floor, notes = _floor_from_source(clip_track, source_track.rig, source_floor)
    clip = _measure(clip_track, floor)
    drift = _drift(clip_track, source_track)
    return Report(clip, _measure(source_track, source_floor), drift, find(clip, drift), notes)


def _measure(track: Track, floor_z: float) -> Measured:
    thresholds = PLAUSIBILITY_V1.scaled(track.rig.hip_height)
    frame_time, window = track.motion.frame_time, thresholds.window
    held = support(track, floor_z, thresholds)
    joints = track.joints[..., 2] - floor_z
    depth = penetration_depth(np.concatenate([held.heights[:, : held.soles], joints], axis=1))
    clearance = held.heights.min(axis=1)
    skates = held.skating()
    wrench = held.unexplained()
    return Measured(
        frame_time=frame_time,
        floor_z=floor_z,
        thresholds=thresholds,
        flags={
            "P": depth.max(axis=1) > thresholds.penetration,
            "F": floating(
                clearance,
                derivative(track.com[:, 2], frame_time, 2, window),
                thresholds.floating,
                thresholds.free_fall,
                held.blur,
            ),
            "S": np.any(skates, axis=1),
            "R": (wrench[:, 0] > thresholds.wrench_force)
            | (wrench[:, 1] > thresholds.wrench_torque),
        },
        depth=depth,
        depth_names=(*track.sides, *track.joint_names),
        clearance=clearance,
        skating=skates,
        speeds=held.speeds[:, : held.soles],
        sides=track.sides,
        unexplained=wrench,
        limits=limit_excess(track.since_tpose, track.rig),
    )


def _floor_from_source(
    track: Track, source_rig: Rig, source_floor: float
) -> tuple[float, tuple[str, ...]]:
    scaled = source_floor * track.rig.hip_height / source_rig.hip_height
    if abs(source_floor) < _FLOOR_AT_ZERO * source_rig.hip_height:
        return scaled, ()
    own = floor_height(track.lowest_point)
    floor = min((0.0, scaled, source_floor), key=lambda z: abs(z - own))
    return floor, (
        f"the source's floor is at z = {source_floor:.2f} m; for the motion it is taken to be at "
        f"z = {floor:.2f} m, the nearest to its feet of that height, scaled, kept or moved to 0",
    )


def _drift(track: Track, source: Track) -> Drift:
    times = np.arange(len(track)) * track.motion.frame_time
    source_time = source.motion.frame_time
    return root_drift(
        track.hips,
        track.heading,
        at_times(source.hips, source_time, times),
        at_times(source.heading, source_time, times),
        track.rig.hip_height / source.rig.hip_height,
    )
