"""Whether what was made from a loop is one: whether it goes on at its first frame."""

from dataclasses import replace

import numpy as np

from sim.trajectory import Subject
from spark.transfer.canonical import CanonicalMotion, to_canonical
from spark.transfer.loops import leap, loop_of

_SEEN = np.radians(5)  # of a joint in one frame


def loop_notes(subject: Subject, source: CanonicalMotion) -> tuple[str, ...]:
    """A note where a motion of as many frames as a source that is a loop jumps at its end."""
    rig, count = subject.rig, len(source)
    if len(subject.motion) != count or (loop := loop_of(source)) is None:
        return ()
    first, last = (
        to_canonical(subject.motion.picked(span), rig) for span in (slice(2), slice(-2, None))
    )
    ends = replace(
        first,
        rotations=np.concatenate([first.rotations, last.rotations]),
        hips=np.concatenate([first.hips, last.hips]),
    )
    angle, joint = leap(ends, loop, count)
    if angle < _SEEN:
        return ()
    role = str(rig.roles.roles[joint]).replace("_", " ")
    return (
        f"the source is a loop and the motion does not close: from its last frame to the first one "
        f"the {role} jumps by {np.degrees(angle):.0f}°",
    )
