"""Judge a motion: how plausible it is, and how it differs from the motion it was made from."""

import numpy as np
from jaxtyping import Float

from sim.report.derivatives import derivative
from sim.report.findings import find
from sim.report.limits import limit_excess
from sim.report.measures import (
    Drift,
    at_times,
    blurred,
    floating,
    floor_height,
    horizontal_speed,
    penetration_depth,
    root_drift,
    skating,
)
from sim.report.result import Measured, Report
from sim.report.thresholds import HUMAN_HIP_HEIGHT, PLAUSIBILITY_V1, Thresholds
from sim.report.track import Track, track
from sim.report.wrench import required_wrench, unexplained
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
    soles = track.points[..., 2] - floor_z
    joints = track.joints[..., 2] - floor_z
    depth = penetration_depth(np.concatenate([soles, joints], axis=1))
    clearance = np.minimum(soles.min(axis=1), (joints - track.flesh).min(axis=1))
    speeds = horizontal_speed(track.points, frame_time, window)
    wrench = _unexplained(track, floor_z, thresholds)
    skates = skating(soles, speeds, thresholds.skate_height, thresholds.skate_speed)
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
                blur=round(window / frame_time),
            ),
            "S": np.any(skates, axis=1),
            "R": (wrench[:, 0] > thresholds.wrench_force)
            | (wrench[:, 1] > thresholds.wrench_torque),
        },
        depth=depth,
        depth_names=(*track.sides, *track.joint_names),
        clearance=clearance,
        skating=skates,
        speeds=speeds,
        sides=track.sides,
        unexplained=wrench,
        limits=limit_excess(track.since_tpose, track.rig),
    )


def _unexplained(track: Track, floor_z: float, thresholds: Thresholds) -> Float[np.ndarray, "T 2"]:
    frame_time, window = track.motion.frame_time, thresholds.window
    below = np.array([0.0, 0.0, 1.0])
    points = np.concatenate([track.points, track.joints - track.flesh[:, None] * below], axis=1)
    # The wrench is a mean over the window: what touched within it may have given it.
    touching = blurred(
        points[..., 2] - floor_z < thresholds.contact_height, round(window / frame_time)
    )
    wrench = required_wrench(
        track.segment_coms, track.world[:, track.body.joints], track.body, frame_time, window
    )
    return unexplained(
        wrench,
        points - track.com[:, None],
        touching,
        thresholds.friction,
        track.rig.hip_height / HUMAN_HIP_HEIGHT,
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
