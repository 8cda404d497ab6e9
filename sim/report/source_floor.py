"""The floor of the source that a motion is compared with, and where it is for the motion."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from sim.report.course import Course
from sim.report.floor import explained, still_feet
from sim.report.measures import floor_height
from sim.report.thresholds import PLAUSIBILITY
from sim.trajectory import Subject
from spark.resample import values_at
from spark.rig.standing import STEADY, on_zero, same_feet
from spark.transfer.canonical import from_canonical, to_canonical
from spark.transfer.ground import Ground, level_ground
from spark.transfer.noise import LEAST_NOISE, noise_in, without_noise

# Hip heights: a source whose floor is further from z = 0 than this does not stand on z = 0, and
# what was made of it may have been put there.
_MAX_FLOOR_OFFSET = 0.1
_DECILES = (10, 50, 90)


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
    course: Course, source: Course, source_floor: float
) -> tuple[float, tuple[str, ...]]:
    """The floor's z [m] under a character, and what there is to say of it.

    It is the source's, scaled, or that under the motion's own soles, where these may be as thick as
    shoes are and it explains as many of the frames in which a foot is still.
    """
    source_rig = source.rig
    scaled = source_floor * course.rig.hip_height / source_rig.hip_height
    own = _under_own_soles(course, source, scaled)
    if own is not None and explained(course, own) >= explained(course, level_ground(scaled)):
        return own.floor_z, (_other_soles(own.floor_z, scaled),)
    if abs(source_floor) < _MAX_FLOOR_OFFSET * source_rig.hip_height:
        return scaled, ()
    lowest = floor_height(course.lowest[:, 2])
    floor = min((0.0, scaled, source_floor), key=lambda z: abs(z - lowest))
    return floor, (
        f"the source's floor is at z = {source_floor:.2f} m; for the motion it is taken to be at "
        f"z = {floor:.2f} m, the nearest to its feet of that height, scaled, kept or moved to 0",
    )


def _under_own_soles(course: Course, source: Course, scaled: float) -> Ground | None:
    """The floor under a motion whose soles are higher over z = 0 than the source's, scaled, or
    lower, by more than what sinks.

    A body's soles are as thick at all times and under both feet: of one that sinks or floats for a
    while, or with one foot, nothing tells them. If two bodies have the same feet, their soles are
    the same.
    """
    over = _over(course, source)
    if same_feet(course.rig, source.rig) or not len(over):
        return None
    low, middle, high = np.percentile(over, _DECILES)
    own = scaled + float(middle)
    steady = high - low < STEADY * course.rig.hip_height
    other = abs(middle) > PLAUSIBILITY.scaled(course.rig.hip_height).penetration
    return level_ground(own) if steady and other and on_zero(course.rig, own) else None


def _over(course: Course, source: Course) -> Float[np.ndarray, "N"]:
    """How much higher [m] soles are than the source's, scaled, of the feet that are still."""
    at = np.arange(len(course)) * course.motion.frame_time / source.motion.frame_time
    scale = course.rig.hip_height / source.rig.hip_height
    roles = (course.rig.roles.roles[joint] for joint in course.rig.contact_joints)
    sides = [None if role is None else role.side for role in roles]
    still = dict(zip(sides, still_feet(course).T, strict=True))
    theirs = {sole.side: k for k, sole in enumerate(source.rig.soles)}
    found = [np.zeros(0)]
    for k, sole in enumerate(course.rig.soles):
        if sole.side in theirs:
            high = scale * values_at(source.soles[:, theirs[sole.side]], at)
            found.append((course.soles[:, k] - high)[still[sole.side]])
    return np.concatenate(found)


def _other_soles(own: float, scaled: float) -> str:
    higher = own - scaled
    return (
        f"the motion stands {100 * abs(higher):.1f} cm {'higher' if higher > 0 else 'lower'} than "
        f"its source, scaled, with its soles {100 * own:.1f} cm over z = 0: as thick as shoes are; "
        "its floor is under them"
    )
