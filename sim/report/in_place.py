"""Walks in place, whose travel was taken out: what a report says of one, and of a motion that was
made from one and travels."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from sim.report.course import Course, course_of
from spark.rig.contacts import planted_points, velocities
from spark.transfer.canonical import to_canonical
from spark.transfer.in_place import MOST_STANDS, pace_of, slow_speed, way_lacked

_GOES = 0.5  # of the speed that the source lacks, scaled: what stays in place has next to none


def in_place_notes(course: Course) -> tuple[str, ...]:
    """A note where a motion walks in place."""
    way = _way(course)
    if way is None:
        return ()
    pace = pace_of(way, course.motion.frame_time)
    return (
        "the motion walks in place: its feet pass over the floor as over a treadmill's belt, at "
        f"{pace:.2f} m/s, and skate for that; `retarget` gives a robot the travel that they tell",
    )


def as_it_travels(source: Course, course: Course) -> tuple[Course, tuple[str, ...]]:
    """The course of a source that walks in place, with the travel that its feet tell where the
    motion made from it travels, and a note; that of any other source as it is, and a note where the
    motion alone walks in place."""
    way = None if source.subject.body is not None else _way(source)
    if way is None:
        return source, in_place_notes(course)
    scale = course.rig.hip_height / source.rig.hip_height
    lacks, goes = (
        slow_speed(velocities(path, each.motion.frame_time)[:, :2], each.motion.frame_time)
        for path, each in ((scale * way, source), (course.hips, course))
    )
    pace = pace_of(way, source.motion.frame_time)
    if goes < _GOES * lacks:
        return source, (
            f"the source walks in place, as on a treadmill at {pace:.2f} m/s, and the motion with "
            "it: their feet skate for that",
        )
    travelling = replace(source.subject, motion=source.motion.moved(way))
    note = (
        "the source walks in place and the motion does not: it is compared with the travel that "
        f"the source's feet tell, {pace:.2f} m/s"
    )
    return course_of(travelling), (note,)


def _way(course: Course) -> Float[np.ndarray, "T 3"] | None:
    """That a motion lacks [m]; of one whose feet stand it is not asked."""
    rig, motion = course.rig, course.motion
    stands = planted_points(course.feet, motion.frame_time, rig.standing_height).any(axis=1)
    if stands.mean() > MOST_STANDS:
        return None
    return way_lacked(to_canonical(motion, rig))
