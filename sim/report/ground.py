"""What a motion is on besides its floor, and what the report says of that."""

import numpy as np

from sim.report.clip_poses import ClipPoses, pose_clip
from sim.report.course import Course
from sim.report.floor import standing_places
from sim.report.measures import Slope, floor_slope
from sim.report.thresholds import PLAUSIBILITY
from spark.transfer.canonical import to_canonical
from spark.transfer.ground import Ground
from spark.transfer.seats import FLESH
from spark.transfer.treads import Treads, treads_of

_NEAR_HIPS = 0.25  # hip heights along the floor from the hips' middle within which a body sits
_POSES = 20  # of a seat, at most, in which that is measured
_OTHER_SEAT = 0.1  # hip heights
_STEEPEST = np.radians(15)  # of a floor that is walked on; feet whose places rise more climb


def ground_under(course: Course, treads: Treads, floor_z: float, scale: float) -> Ground:
    """The ground that a motion should be on whose source, `scale` times smaller, is on these.

    Of a seat nothing but the source's hips is known: it is where the motion's own lowest points are
    that sit, at most `_OTHER_SEAT` from where they should be.
    """
    rig, frame_time = course.rig, course.motion.frame_time
    roles = [rig.roles.roles[j] for j in rig.contact_joints]
    feet = course.feet[..., :2].swapaxes(0, 1)
    ways = {role.side: way for role, way in zip(roles, feet, strict=True) if role is not None}
    ground = treads.under(rig, ways, frame_time, floor_z, scale)
    rate, most, seats = treads.frame_time / frame_time, _OTHER_SEAT * rig.hip_height, []
    for seat in treads.seats:
        start, stop = (min(round(at * rate), len(course)) for at in (seat.start, seat.stop))
        if start < stop:
            step = max(1, (stop - start) // _POSES)
            poses = pose_clip(course.subject.picked(slice(start, stop, step)))
            depth = _depth(poses)
            hips = np.median(poses.hips, axis=0)
            expected = floor_z + scale * seat.high
            seats.append([*hips[:2], np.clip(hips[2], expected - most, expected + most) - depth])
    return ground.with_tops(seats, rig.hip_height)


def _depth(poses: ClipPoses) -> float:
    """How far [m] below the middle of a body's hips its lowest points near these are."""
    away = np.linalg.norm((poses.part_points - poses.hips[:, None])[..., :2], axis=-1)
    lowest = poses.part_points[..., 2] - poses.part_radii
    reach = np.where(away < _NEAR_HIPS * poses.rig.hip_height, lowest, np.inf)
    depth = float(np.median(poses.hips[:, 2] - reach.min(axis=1, initial=np.inf)))
    return depth if np.isfinite(depth) else FLESH * poses.rig.standing_height


def own_ground_notes(course: Course, floor: Ground) -> tuple[str, ...]:
    """Notes where a motion without a source is on more than a level floor."""
    treads = treads_of(to_canonical(course.motion, course.rig))
    seats = tuple(
        f"the body sits, with its hips {high} cm above the floor, and its feet can't hold it "
        "there: it counts as out of balance; beside a source that sits (--source) it does not"
        for high in treads.seat_heights
    )
    if treads.level:
        return _slope(course, floor, "the") + seats
    return (
        f"the feet stand still up to {100 * treads.top:.0f} cm above the floor, and carry the body "
        "there: all that is high up counts as floating; beside a source that stands as high "
        "(--source) it does not",
        *seats,
    )


def source_ground_notes(
    course: Course, floor: Ground, treads: Treads, scale: float
) -> tuple[str, ...]:
    """Notes where a source is on more than a level floor."""
    seats = tuple(
        f"the source sits, with its hips {high} cm above its floor, and its feet can't hold it "
        "there: a seat is below them, and below the motion's"
        for high in treads.seat_heights
    )
    if treads.level:
        return _slope(course, floor, "the source's") + seats
    return (
        f"the source's feet stand still up to {100 * treads.top:.0f} cm above its floor, and carry "
        f"it there: that is ground, for the motion up to {100 * scale * treads.top:.0f} cm high",
        *seats,
    )


def _slope(course: Course, floor: Ground, whose: str) -> tuple[str, ...]:
    """A note where the feet stand on a slope: recorded floors are off level by a degree or two."""
    places = standing_places(course)
    slope, there = floor_slope(places), "and there count as floating"
    if any(floor.gradient):
        gradient, middle = np.array(floor.gradient), np.array(floor.middle)
        slope = Slope(gradient, middle, float(np.ptp(places[:, :2] @ gradient)))
        there = "and the floor is taken to be that slope"
    if slope.rise < PLAUSIBILITY.scaled(course.rig.hip_height).floating / 2:
        return ()
    if slope.angle > _STEEPEST:
        return (
            f"{whose} feet stand higher step by step: it climbs, and all that is high up counts as "
            "floating",
        )
    return (
        f"{whose} floor slopes by {np.degrees(slope.angle):.1f}°: the feet stand "
        f"{100 * slope.rise:.0f} cm higher at one end of it, {there}",
    )
