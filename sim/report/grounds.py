"""The grounds that a motion and its source are judged on."""

from typing import NamedTuple

from sim.report.course import Course
from sim.report.floor import copied_floor, on_floor, own_floor
from sim.report.ground import ground_under, own_ground_notes, source_ground_notes
from sim.report.stated import stated_ground
from spark.transfer.canonical import CanonicalMotion
from spark.transfer.ground import Ground, level_ground
from spark.transfer.treads import treads_of


class Grounds(NamedTuple):
    """That of a motion; that of its source; the source's own floor where the motion's is level
    instead, so that swings have to be compared over a level one; and notes."""

    own: Ground
    source: Ground
    lost_slope: Ground | None
    notes: tuple[str, ...]


def ground_of(course: Course) -> tuple[Ground, tuple[str, ...]]:
    """The ground of a motion by itself, and notes: what is stated, or its own floor."""
    if (stated := stated_ground(course)) is not None:
        return stated.own, stated.notes
    ground = own_floor(course)
    notes = own_ground_notes(course, ground)
    if course.subject.body is None:
        own = "the floor is the clip's own: one that floats or sinks as a whole can't be told"
        notes = (own, *notes)
    return ground, notes


def grounds_beside(
    course: Course,
    source: Course,
    quiet: CanonicalMotion,
    floor: float,
    source_floor: float,
    *,
    trembles: bool,
) -> Grounds:
    """Those of a motion and of its source: what is stated, or else what the source's feet tell,
    which are `quiet` where it `trembles`, over floors so high [m, world]."""
    scale = course.rig.hip_height / source.rig.hip_height
    stated = stated_ground(course, source, scale)
    if stated is not None and stated.source is not None:
        return Grounds(stated.own, stated.source, None, stated.notes)
    treads = treads_of(quiet)
    slope = level_ground(source_floor) if trembles else own_floor(source)
    notes = source_ground_notes(source, slope, treads, scale)
    under = treads.ground(source_floor)
    if treads.level:
        under = on_floor(under, slope)
    if stated is not None:
        return Grounds(stated.own, under, None, (*stated.notes, *notes))
    ground = ground_under(course, treads, floor, scale)
    if not treads.level:
        return Grounds(ground, under, None, notes)
    copied = copied_floor(course, floor, source, source_floor, slope, scale)
    if copied is None:
        return Grounds(ground, under, slope, notes)
    return Grounds(on_floor(ground, copied), under, None, notes)
