"""The floor of the source that a motion is compared with, and where it is for the motion."""

from dataclasses import replace

from sim.report.course import Course
from sim.report.measures import floor_height
from sim.trajectory import Subject
from spark.rig.rig import Rig
from spark.transfer.canonical import from_canonical, to_canonical
from spark.transfer.noise import LEAST_NOISE, noise_in, without_noise

# Hip heights: a source whose floor is further from z = 0 than this does not stand on z = 0, and
# what was made of it may have been put there.
_MAX_FLOOR_OFFSET = 0.1


def without_tremble(course: Course) -> tuple[Subject, float, tuple[str, ...]]:
    """What a source's feet, limbs and floor are told from: of one that trembles, from what it
    trembles about. Noise takes soles below the floor, and no foot stands."""
    subject = course.subject
    floor = floor_height(course.lowest[:, 2]) if subject.body is None else 0.0
    height, frame_time = course.rig.standing_height, course.motion.frame_time
    trembles = noise_in(course.feet, course.hips, height, frame_time).feet >= LEAST_NOISE
    if subject.body is not None or not trembles:
        return subject, floor, ()
    quiet, noise, _ = without_noise(to_canonical(subject.motion, subject.rig))
    if noise is None:
        return subject, floor, ()
    higher = 100 * (quiet.floor_z - floor)
    note = (
        f"the source's feet tremble by {1000 * noise.feet:.0f} mm of white noise (of an adult): "
        f"its floor is that of its smoothed motion, {higher:.1f} cm higher than the 5th percentile "
        "of its lowest sole point, and so are the contacts, swings and limbs to compare with"
    )
    return replace(subject, motion=from_canonical(quiet)), quiet.floor_z, (note,)


def floor_from_source(
    course: Course, source_rig: Rig, source_floor: float
) -> tuple[float, tuple[str, ...]]:
    scaled = source_floor * course.rig.hip_height / source_rig.hip_height
    if abs(source_floor) < _MAX_FLOOR_OFFSET * source_rig.hip_height:
        return scaled, ()
    own = floor_height(course.lowest[:, 2])
    floor = min((0.0, scaled, source_floor), key=lambda z: abs(z - own))
    return floor, (
        f"the source's floor is at z = {source_floor:.2f} m; for the motion it is taken to be at "
        f"z = {floor:.2f} m, the nearest to its feet of that height, scaled, kept or moved to 0",
    )
